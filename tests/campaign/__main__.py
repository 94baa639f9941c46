"""Command line of the fault campaign: fly faults in every state of the landing, and report.

python -m tests.campaign --flights 2000 --out out/campaign
"""

from __future__ import annotations

import argparse
import gc
import logging
import sys
from dataclasses import replace
from pathlib import Path

from rich.console import Console
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)

from companion.runtime.program_version import program_version
from sitl import scenes
from tests.campaign import log, reactions, report
from tests.campaign.flight import fly
from tests.campaign.plan import CELLS, FAULTS, Plan, plan


def main() -> None:
    """Fly what is missing, then write the report; exit 1 if any flight failed."""
    own = _arguments()
    logging.disable(logging.CRITICAL)
    own.out.mkdir(parents=True, exist_ok=True)
    path = own.out / "flights.jsonl"
    plans = [plan(n) for n in range(own.first, own.first + own.flights)]
    plans = [p for p in plans if p.fault in own.fault]
    if own.scene:
        plans = [replace(p, scene=own.scene[p.number % len(own.scene)]) for p in plans]
    if not own.report:
        flown = log.read(path)
        _fly([p for p in plans if p.number not in flown], path, len(plans))
    wanted = {p.number for p in plans}
    flights = [flight for n, flight in sorted(log.read(path).items()) if n in wanted]
    failed = report.write(flights, own.out)
    print(f"{len(flights)} flights, {failed} failed: {own.out / 'report.md'}")
    sys.exit(1 if failed or len(flights) < len(plans) else 0)


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="python -m tests.campaign", description=__doc__)
    parser.add_argument(
        "--flights", type=int, default=len(CELLS), help=f"each {len(CELLS)} hold each cell once"
    )
    parser.add_argument("--first", type=int, default=0, help="number of the first")
    parser.add_argument("--fault", choices=FAULTS, nargs="+", default=FAULTS, help="only these")
    parser.add_argument("--scene", choices=scenes.NAMES, nargs="+", help="in these scenes, in turn")
    parser.add_argument("--out", type=Path, default=Path("out/campaign"), help="goes on where it was stopped")
    parser.add_argument("--report", action="store_true", help="fly nothing, write the report anew")
    return parser.parse_args()


def _fly(plans: list[Plan], path: Path, total: int) -> None:
    columns = TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn()
    program = program_version()
    gc.collect()
    gc.freeze()  # what is loaded stays: collections between flights need not look at it
    with Progress(*columns, TimeRemainingColumn(), console=Console(stderr=True)) as progress:
        task = progress.add_task("flights", total=total, completed=total - len(plans))
        for each in plans:
            progress.update(task, description=f"{each.fault} in {each.state.value}")
            flown = fly(each, path.parent)
            judged = {"not_as_stated": reactions.faults_of(flown), "program": program}
            log.append(path, flown | judged)
            progress.advance(task)


if __name__ == "__main__":
    main()
