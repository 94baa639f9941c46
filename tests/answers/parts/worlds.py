"""Maps of the closed-form worlds: `slz.Pipeline` window by window, through the shared worker."""

from __future__ import annotations

import importlib.util
import json
import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType
from typing import IO, Any

import numpy as np

from tests import REPOSITORY
from tests.answers.program import ProgramError, environment
from tests.answers.recorder import Recorder
from tests.answers.shared import SHARED, absent

WORLDS = SHARED / "worlds" / "worlds.py"
WORKER = SHARED / "worlds" / "worker.py"
DENSITY_PER_M2 = 20.0
SEED = 1
MODES = ("flight", "map", "source")


def record(recorder: Recorder) -> None:
    """Record state, certainty, slope, relief and zones of every world in each mode."""
    for path in (WORLDS, WORKER):
        if line := absent(path):
            recorder.skip(line)
            return
    worlds = _module(WORLDS)
    command = [sys.executable, str(WORKER)]
    with subprocess.Popen(
        command,
        cwd=REPOSITORY,
        env=environment(recorder.work / "state"),
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    ) as worker:
        assert worker.stdin is not None
        assert worker.stdout is not None
        for name, file in _scans(worlds, recorder.work):
            for mode in MODES:
                recorder.add(f"{name}/{mode}", _answer(worker.stdin, worker.stdout, mode, file))
        worker.stdin.close()


def _scans(worlds: ModuleType, work: Path) -> Iterator[tuple[str, Path]]:
    """Yield each world's name and the file of its returns."""
    file = work / "returns.npz"
    for name, _kind, surface, wires in worlds.worlds():
        points, window, sensors = worlds.scan(surface, wires, DENSITY_PER_M2, SEED)
        np.savez(file, points=points, window=window, sensors=sensors)
        yield re.sub(r"[^a-z0-9.-]+", "_", name.lower()).strip("_"), file


def _answer(asked: IO[str], answers: IO[str], mode: str, file: Path) -> dict[str, Any]:
    """Return the maps of a world, and how many returns each window used."""
    out = file.with_name("maps.npz")
    asked.write(f"{mode} {file} {out}\n")
    asked.flush()
    line = answers.readline()
    if not line:
        raise ProgramError(f"{WORKER.name} ended at {mode}")
    with np.load(out) as maps:
        return {"used": json.loads(line)["used"]} | {name: maps[name] for name in maps.files}


def _module(path: Path) -> ModuleType:
    spec = importlib.util.spec_from_file_location(path.stem, path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[path.stem] = module
    spec.loader.exec_module(module)
    return module
