"""Mutation run: mutants against the tests that reach them; resumable.

`python -m tests.mutation --seed 1 --count 200`
"""

from __future__ import annotations

import argparse
import json
import os
import re
import sys
from pathlib import Path
from typing import TypedDict

from tests.coverage.parts import costs_file
from tests.mutation import trial
from tests.mutation.mutants import Mutant, changed, sample
from tests.mutation.reached import Reached
from tests.mutation.report import written

ROOT = Path(__file__).resolve().parents[2]
QUICK_S, WIDE_S = 5.0, 40.0
FIRST_FAILURE = re.compile(r"^(?:FAILED|ERROR) (\S+)", re.MULTILINE)


class Result(TypedDict):
    """What became of a mutant: how it was tried, and the test that noticed."""

    mutant: str
    line: str
    outcome: str
    tests: int
    by: str


def judged(mutant: Mutant, reached: Reached, log: Path) -> Result:
    """Try a mutant before the quick tests of its statement; one that lives, before those of its file."""
    file = ROOT / mutant.path
    source = file.read_text()
    text = changed(source, mutant)
    near, wide = reached.by_line(file, mutant.line), reached.by_file(file)
    quick = reached.within(near or wide, QUICK_S) if near or wide else []
    rest = reached.within([t for t in [*near, *wide] if t not in set(quick)], WIDE_S)
    outcome, n_tests = trial.SURVIVED, 0
    for tests in (quick, list(dict.fromkeys(rest))):
        if tests and outcome == trial.SURVIVED:
            limit_s = 10.0 + 5.0 * sum(map(reached.cost_s, tests))
            outcome = trial.tried(ROOT, mutant.path, text, tests, limit_s, log)
            n_tests += len(tests)
    failed = FIRST_FAILURE.search(log.read_text(errors="replace")) if outcome == trial.KILLED else None
    return Result(
        mutant=mutant.name, line=text.splitlines()[mutant.line - 1].strip(), outcome=outcome, tests=n_tests,
        by=failed[1] if failed else "",
    )  # fmt: skip


def main() -> int:
    """Go on with the sample, write results and report; 1 if less than the goal is killed."""
    asked = argparse.ArgumentParser(description=__doc__)
    asked.add_argument("--seed", type=int, default=1)
    asked.add_argument("--count", type=int, default=200)
    asked.add_argument("--goal", type=float, default=0.85, help="share to be killed")
    asked.add_argument(
        "--reached", type=Path, default=Path("out/coverage/uncompiled"), help="data of `make coverage`"
    )
    asked.add_argument("--out", type=Path, default=Path("out/mutation"))
    options = asked.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    done = options.out / f"seed-{options.seed}.jsonl"
    results = [json.loads(line) for line in done.read_text().splitlines()] if done.is_file() else []
    known = {result["mutant"] for result in results}
    try:
        reached = Reached(options.reached, costs_file(options.reached))
        trial.prepare()
    except (FileNotFoundError, RuntimeError) as error:
        print(f"mutation: {error}", file=sys.stderr)
        return 2
    paths = [str(p.relative_to(ROOT)) for p in sorted(ROOT.glob("slz/**/*.py"))]
    for mutant in sample(ROOT, paths, options.seed, options.count):
        if mutant.name in known:
            continue
        result = judged(mutant, reached, options.out / "last.log")
        results.append(dict(result))
        with done.open("a") as file:
            file.write(json.dumps(result) + "\n")
        print(f"{len(results):4}/{options.count} {result['outcome']:14} {mutant.name}", flush=True)
    return written(results, options.out / "report.md", options.goal)


if __name__ == "__main__":
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    sys.exit(main())
