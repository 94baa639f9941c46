"""`python -m tests.answers`: record the program's answers, or compare two records."""

from __future__ import annotations

import argparse
import resource
import sys
import tempfile
from pathlib import Path

from tests.answers.comparison import compared
from tests.answers.parts import PARTS
from tests.answers.program import ProgramError
from tests.answers.recorder import Recorder
from tests.answers.store import Store


def main(arguments: list[str] | None = None) -> int:
    """Record or compare; 0 done and equal, 1 different or failed."""
    parser = argparse.ArgumentParser(prog="python -m tests.answers", description=__doc__)
    commands = parser.add_subparsers(dest="command", required=True)
    asked = commands.add_parser("record", help="run the program and store its answers")
    asked.add_argument("--out", type=Path, required=True, help="folder of the record; parts are replaced")
    asked.add_argument("--part", action="append", choices=list(PARTS), help="this part only; repeatable")
    asked.add_argument("--full", action="store_true", help="all 60 windows of every workload (20 min more)")
    asked = commands.add_parser("compare", help="name each difference of two records; exit 1 if there is one")
    asked.add_argument("before", type=Path)
    asked.add_argument("after", type=Path)
    options = parser.parse_args(arguments)
    if options.command == "record":
        return record(options.out, options.part or list(PARTS), options.full)
    return compare(options.before, options.after)


def record(out: Path, parts: list[str], full: bool = False) -> int:
    """Record parts one after the other; a part that fails does not stop the others."""
    store, code = Store(out), 0
    for name in parts:
        store.forget(name)
        before = _cpu_s()
        with tempfile.TemporaryDirectory(prefix="slz-answers-") as work:
            recorder = Recorder(name, Path(work).resolve(), store, full)
            try:
                PARTS[name](recorder)
            except ProgramError as error:
                print(f"answers: {name}: failed: {error}", file=sys.stderr)
                store.finish(name, failed=True)
                code = 1
                continue
        spent_s = round(_cpu_s() - before, 1)
        store.finish(name, failed=False, skipped=recorder.skipped, cpu_s=spent_s)
        print(f"answers: {name}: {spent_s} s of processor time", flush=True)
    return code


def compare(before: Path, after: Path) -> int:
    """Print one line for each difference; 1 where there is one."""
    lines = list(compared(Store(before), Store(after)))
    for line in lines:
        print(line)
    if not lines:
        print(f"{len(Store(before).digests)} answers, bit for bit the same")
    return 1 if lines else 0


def _cpu_s() -> float:
    spent = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    return sum(one.ru_utime + one.ru_stime for one in spent)


if __name__ == "__main__":
    sys.exit(main())
