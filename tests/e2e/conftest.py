"""Surveys that several modules share, and flights that leave the garbage collector alone."""

from __future__ import annotations

from pathlib import Path
from unittest import mock

import pytest


@pytest.fixture(scope="session")
def surveys(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the folder of the session's surveys."""
    return tmp_path_factory.mktemp("surveys")


@pytest.fixture(autouse=True)
def _collector_is_the_session_s(monkeypatch: pytest.MonkeyPatch) -> None:
    """What the session froze stays frozen: a full collection costs as much as 5 s of flight."""
    monkeypatch.setattr("companion.flight.app.gc", mock.Mock())
