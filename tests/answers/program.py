"""The `slz` program of this checkout, run in a process of its own."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tomllib
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from tests import REPOSITORY

PROBE = Path(__file__).parent / "probe"
OUTPUT = "SLZ_PROBE"
"""Environment variable with the folder into which the probe writes; unset, it is off."""


class ProgramError(Exception):
    """The program did not answer."""


def entry_point(name: str = "slz") -> str:
    """Return Python code that runs a program which pyproject.toml names, from this checkout."""
    scripts = tomllib.loads((REPOSITORY / "pyproject.toml").read_text("utf-8"))["project"]["scripts"]
    module, _, function = scripts[name].partition(":")
    return f"import sys; sys.argv[0] = {name!r}; from {module} import {function} as main; sys.exit(main())"


def environment(state: Path, probe: Path | None = None) -> dict[str, str]:
    """Return the program's environment: this checkout's code, and no state of earlier runs.

    probe: folder for what the probe notes of the program and of the processes that it starts.
    """
    paths = [str(REPOSITORY)] if probe is None else [str(PROBE), str(REPOSITORY)]
    own = {
        "PYTHONPATH": os.pathsep.join(paths),
        "XDG_STATE_HOME": str(state),
        "OPENBLAS_NUM_THREADS": "1",
        "COLUMNS": "120",
        "TZ": "UTC",
    }
    if probe is not None:
        own[OUTPUT] = str(probe)
    return {key: value for key, value in os.environ.items() if key != OUTPUT} | own


def slz(
    arguments: Sequence[str], work: Path, *, codes: Sequence[int] = (0,), probe: Path | None = None
) -> Any:
    """Run `slz` with arguments and `--json` in a folder, and return what it answers, with its exit code.

    Raises
    ------
    ProgramError
        The exit code is not among `codes`, or the output is no JSON object.
    """
    command = [sys.executable, "-c", entry_point(), *arguments, "--json"]
    state = work / "state"
    done = subprocess.run(
        command, cwd=work, env=environment(state, probe), capture_output=True, text=True, check=False
    )
    if done.returncode not in codes:
        last = done.stderr.strip().splitlines()[-3:]
        raise ProgramError(f"slz {' '.join(arguments)}: exit code {done.returncode}: {' | '.join(last)}")
    try:
        answer = json.loads(done.stdout)
    except ValueError:
        raise ProgramError(f"slz {' '.join(arguments)}: its output is no JSON object") from None
    return {**answer, "exit_code": done.returncode}
