"""Real recordings of sensors, found through SLZ_DATA; a test of one that is absent is skipped."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from tests import REPOSITORY

DATA = Path(os.environ.get("SLZ_DATA", REPOSITORY.parent / "shared/data"))


def recording(name: str) -> Path:
    """Return a file or folder of the recordings; skip the test if it is not there."""
    path = DATA / name
    if not path.exists():
        pytest.skip(f"{path} is absent: set SLZ_DATA")
    return path
