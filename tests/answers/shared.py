"""Clouds, generators and worlds that are not part of the repository."""

from __future__ import annotations

import os
from pathlib import Path

from tests import REPOSITORY

DATA = Path(os.environ.get("SLZ_DATA", REPOSITORY.parent / "shared/data"))
"""Recordings and clouds."""
SHARED = Path(os.environ.get("SLZ_SHARED", DATA.parent))
"""Folder with `bench/` (generator of workloads) and `worlds/` (closed-form worlds)."""


def absent(path: Path) -> str | None:
    """Return a line that says what is missing, None where the file exists."""
    return None if path.exists() else f"{path} is absent: set SLZ_DATA (and SLZ_SHARED)"
