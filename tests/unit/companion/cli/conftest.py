"""Fixture of the command line's tests."""

from __future__ import annotations

import logging
import sys

import pytest


@pytest.fixture(autouse=True)
def arguments(monkeypatch: pytest.MonkeyPatch) -> None:
    """Leave the test run's own arguments and logging as they are."""
    monkeypatch.setattr(sys, "argv", ["slz"])
    monkeypatch.setattr(logging, "basicConfig", lambda **_: None)
