"""Raw data of the flash LiDAR and the radar from the simulator, and their sections of the page."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from companion.desk.reproduce import flash_section, radar_section
from companion.desk.reproduce.reproduction_page import Section
from companion.runtime.errors import CompanionError

NAMES = ("flash", "radar")
SEED = 1
LONGEST_S = 1800.0


def sections(names: list[str], out: Path, progress: Callable[[str], None]) -> list[Section]:
    """Return the sections of the named instruments, recording their data first where needed."""
    build = {"flash": flash_section.section, "radar": radar_section.section}
    found = []
    for name in names:
        progress(name)
        found.append(build[name](_recorded(name, out / "surveys"), out / name))
    return found


def _recorded(name: str, folder: Path) -> dict[str, Any]:
    """Return the arrays of an instrument's recording, made by the simulator if the file is missing."""
    file = folder / f"{name}_seed{SEED}.npz"
    if not file.exists():
        folder.mkdir(parents=True, exist_ok=True)
        partial = file.with_suffix(f".{os.getpid()}.npz")
        command = [
            sys.executable,
            "-m",
            f"sitl.sensors.{name}.record_{name}",
            f"--seed={SEED}",
            f"--out={partial}",
        ]
        done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=LONGEST_S)
        if done.returncode:
            last = done.stderr.strip().splitlines()[-1] if done.stderr.strip() else "no reason given"
            raise CompanionError(f"the simulator could not record the {name}: {last}")
        partial.replace(file)
    with np.load(file) as data:
        return dict(data)
