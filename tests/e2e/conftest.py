"""Session fixtures: surveys that several modules share."""

from __future__ import annotations

from pathlib import Path

import pytest


@pytest.fixture(scope="session")
def surveys(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the folder of the session's surveys."""
    return tmp_path_factory.mktemp("surveys")
