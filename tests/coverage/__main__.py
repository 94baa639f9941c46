"""Coverage run: run the parts, combine them, report, fail under the goal (`python -m tests.coverage`)."""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
from pathlib import Path

from tests.coverage.parts import PARTS, PROGRAMS, Part, costs_file

GOAL_PERCENT = 95
COVERAGE = (sys.executable, "-m", "coverage")


def measured(part: Part, data: Path, more: list[str]) -> int:
    """Run a part; return pytest's exit code."""
    command = [
        "pytest",
        "-q",
        "-p",
        "no:cacheprovider",
        *part.options(),
        "--costs",
        str(costs_file(data)),
        *more,
    ]
    return run(command, data, part.compiled)


def run(command: list[str], data: Path, compiled: bool = True) -> int:
    """Run a module with its arguments under coverage; return its exit code."""
    print(f"coverage: {data.name}", flush=True)
    environment = dict(os.environ, COVERAGE_FILE=str(data), NUMBA_DISABLE_JIT="0" if compiled else "1")
    code = subprocess.run([*COVERAGE, "run", "-m", *command], env=environment, check=False).returncode
    # Each process that the tests started left a file of its own.
    subprocess.run([*COVERAGE, "combine", "--quiet"], env=environment, check=False)
    return code


def reported(out: Path) -> int:
    """Combine what is there and report it; return other than 0 under the goal."""
    names = [*(part.name for part in PARTS), *PROGRAMS]
    parts = [str(out / name) for name in names if (out / name).is_file()]
    if not parts:
        print(f"coverage: nothing was measured in {out}: run `make coverage`", file=sys.stderr)
        return 2
    environment = dict(os.environ, COVERAGE_FILE=str(out / "together"))
    for step in (["combine", "--keep", "--quiet", *parts], ["html", "--quiet", "-d", str(out / "html")]):
        subprocess.run([*COVERAGE, *step], env=environment, check=True)
    report = ["report", "--show-missing", "--skip-covered", "--sort=cover", f"--fail-under={GOAL_PERCENT}"]
    return subprocess.run([*COVERAGE, *report], env=environment, check=False).returncode


def main() -> int:
    """Measure what is asked for; 0 if all pass and, with what was measured before, the goal is reached."""
    names = [*(part.name for part in PARTS), *PROGRAMS]
    asked = argparse.ArgumentParser(description=__doc__)
    asked.add_argument("--part", action="append", choices=names, help="run it alone; repeatable")
    asked.add_argument("--report", action="store_true", help="run nothing, report what is there")
    asked.add_argument("--out", type=Path, default=Path("out/coverage"))
    asked.add_argument("more", nargs="*", help="options for pytest, after --")
    options = asked.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    wanted = [] if options.report else options.part or names
    chosen = [part for part in PARTS if part.name in wanted]
    failed = [part.name for part in chosen if measured(part, options.out / part.name, options.more)]
    for name in [name for name in PROGRAMS if name in wanted]:
        arguments = [argument.format(out=options.out) for argument in PROGRAMS[name]]
        if run(["companion.cli", *arguments], options.out / name):
            failed.append(name)
    under = reported(options.out)
    if failed:
        print(f"coverage: failed in {', '.join(failed)}", file=sys.stderr)
    return 1 if failed else under


if __name__ == "__main__":
    sys.exit(main())
