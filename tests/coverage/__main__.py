"""`python -m tests.coverage`: run the parts under coverage, combine them, report, fail under the goal."""

from __future__ import annotations

import argparse
import os
import shutil
import subprocess
import sys
from pathlib import Path

from tests.coverage.parts import PARTS, Part

GOAL_PERCENT = 95


def measured(part: Part, data: Path, more: list[str]) -> int:
    """Run a part; return pytest's exit code."""
    environment = dict(os.environ, COVERAGE_FILE=str(data), NUMBA_DISABLE_JIT="0" if part.compiled else "1")
    command = [sys.executable, "-m", "coverage", "run", "-m", "pytest", "-q", "-p", "no:cacheprovider"]
    costs = ["--costs", str(data.with_suffix(".json"))]
    print(f"coverage: {part.name}", flush=True)
    return subprocess.run([*command, *part.options(), *costs, *more], env=environment, check=False).returncode


def main() -> int:
    """Measure what is asked for, combine it with what is there; 0 if all pass and the goal is reached."""
    asked = argparse.ArgumentParser(description=__doc__)
    asked.add_argument(
        "--part", action="append", choices=[p.name for p in PARTS], help="run it alone; repeatable"
    )
    asked.add_argument("--report", action="store_true", help="run nothing, report what is there")
    asked.add_argument("--out", type=Path, default=Path("out/coverage"))
    asked.add_argument("more", nargs="*", help="options for pytest")
    options = asked.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    chosen = (
        [] if options.report else [p for p in PARTS if p.name in (options.part or [q.name for q in PARTS])]
    )
    failed = [part.name for part in chosen if measured(part, options.out / part.name, options.more)]
    parts = [str(options.out / p.name) for p in PARTS if (options.out / p.name).is_file()]
    together = shutil.which("coverage", path=str(Path(sys.executable).parent)) or "coverage"
    environment = dict(os.environ, COVERAGE_FILE=str(options.out / "together"))
    subprocess.run([together, "combine", "--keep", "--quiet", *parts], env=environment, check=True)
    subprocess.run(
        [together, "html", "--quiet", "-d", str(options.out / "html")], env=environment, check=True
    )
    report = [
        together,
        "report",
        "--show-missing",
        "--skip-covered",
        "--sort",
        "cover",
        f"--fail-under={GOAL_PERCENT}",
    ]
    under = subprocess.run(report, env=environment, check=False).returncode
    if failed:
        print(f"coverage: tests failed in {', '.join(failed)}", file=sys.stderr)
    return 1 if failed or under else 0


if __name__ == "__main__":
    sys.exit(main())
