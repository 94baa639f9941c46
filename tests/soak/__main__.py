"""Soak test of the companion, with a report of everything that did not stay constant.

python -m tests.soak simulated --hours 24
python -m tests.soak real --hours 2
"""

from __future__ import annotations

import argparse
import asyncio
import json
import logging
import sys
from pathlib import Path

from companion.runtime.program_version import program_version
from tests.soak import picture, real
from tests.soak.simulated import Day
from tests.soak.verdict import judge

HOURS = {"simulated": 24.0, "real": 2.0}


def main() -> None:
    """Run, draw, tell; exit 1 if anything grew."""
    parser = argparse.ArgumentParser(prog="python -m tests.soak", description=__doc__)
    parser.add_argument("clock", choices=HOURS)
    parser.add_argument("--hours", type=float, help=f"default: {HOURS}")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--out", type=Path, default=Path("out/soak"))
    own = parser.parse_args()
    logging.disable(logging.CRITICAL)
    hours = own.hours or HOURS[own.clock]
    path = own.out / f"{own.clock}.jsonl"
    made_by = {"clock": own.clock, "seed": own.seed, "program": program_version()}
    came_of = {}
    if own.clock == "simulated":
        day = Day(hours, path, own.seed)
        gauges, came_of = day.fly(), day.came_of
    else:
        gauges = asyncio.run(real.run(hours, path))
    told = made_by | judge(gauges.readings) | ({"came_of": came_of} if came_of else {})
    picture.draw(gauges.readings, path.with_suffix(".png"))
    path.with_suffix(".json").write_text(json.dumps(told) + "\n", "utf-8")
    print(json.dumps(told))
    sys.exit(1 if told["failed"] or came_of.get("unsafe") else 0)


if __name__ == "__main__":
    main()
