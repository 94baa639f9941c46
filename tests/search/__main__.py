"""Command line of the rare-event search.

python -m tests.search hunt --out out/search            # the program as it is
python -m tests.search plant --out out/search           # the five planted weaknesses
python -m tests.search count --landings 10000 --out out/search    # evenly drawn cheap landings
python -m tests.search count --planted --landings 2000 --out out/search
python -m tests.search equal --scenarios 100 --out out/search
python -m tests.search model                            # forms of the search: hunts in a model of the flight
python -m tests.search replay FILE.json [--detail full] [--weakness NAME]
"""

from __future__ import annotations

import argparse
import gc
import json
import logging
import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import asdict
from pathlib import Path
from typing import Any

from companion.runtime.program_version import program_version
from tests.search import counts, equality
from tests.search.flight import CHEAP, COARSE, DETAILS, TAKEN, UNSAFE, fly
from tests.search.flight_model import FlightModel
from tests.search.flights import Flier
from tests.search.flown_file import InputError, read_object
from tests.search.hunt import Hunt, is_failure
from tests.search.scenario import Scenario, one_trouble, read, uniform
from tests.search.shrink import shrink
from tests.search.weaknesses import WEAKNESSES, all_at_once

coarsely = Flier(COARSE)


def main() -> None:
    """Run one command.

    Exit code 1: the program as it is was found unsafe, a weakness was not found, or was found by evenly drawn
    flights, an outcome is not equal, or the replayed flight is unsafe. 2: an option or file cannot be used.
    """
    own = _arguments()
    logging.disable(logging.CRITICAL)
    gc.collect()
    gc.freeze()  # what is loaded stays: collections between flights need not look at it
    try:
        sys.exit(own.run(own))
    except (InputError, OSError) as error:
        print(f"tests.search: {error}", file=sys.stderr)
        sys.exit(2)


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="python -m tests.search", description=__doc__)
    commands = parser.add_subparsers(required=True)
    for name, run in (
        ("hunt", _hunt),
        ("plant", _plant),
        ("count", _count),
        ("equal", _equal),
        ("model", _model),
    ):
        command = commands.add_parser(name)
        command.set_defaults(run=run)
        command.add_argument(
            "--out", type=Path, default=Path("out/search"), help="goes on where it was stopped"
        )
        command.add_argument("--seed", type=at_least(0), default=1)
        command.add_argument("--landings", type=at_least(1), default=10_000 if name == "count" else 600)
        command.add_argument("--scenarios", type=at_least(1), default=100)
        command.add_argument("--hunts", type=at_least(1), default=20, help="of each modelled weakness")
        command.add_argument("--weakness", choices=WEAKNESSES, nargs="+", default=list(WEAKNESSES))
        command.add_argument("--failures", type=at_least(1), default=3, help="to find before the hunt ends")
        command.add_argument("--jobs", type=at_least(1), default=1)
        command.add_argument("--planted", action="store_true", help="count with all weaknesses at once")
        command.add_argument("--flights-to-shrink", type=at_least(0), default=60)
    replay = commands.add_parser("replay")
    replay.set_defaults(run=_replay)
    replay.add_argument("file", type=Path)
    replay.add_argument("--detail", choices=DETAILS, help="by default that of the file, or cheap")
    replay.add_argument("--weakness", choices=WEAKNESSES)
    return parser.parse_args()


def at_least(least: int) -> Callable[[str], int]:
    """Return what reads a whole number, not less than some."""

    def whole(text: str) -> int:
        number = int(text)
        if number < least:
            raise argparse.ArgumentTypeError(f"{text} is less than {least}")
        return number

    return whole


def _hunt(own: argparse.Namespace) -> int:
    hunt = Hunt(own.out / "hunt.jsonl", coarsely, own.seed, jobs=own.jobs)
    failures = hunt.run(own.landings, failures=own.failures)
    for number, scenario in enumerate(failures):
        _keep(own, scenario, f"hunt-{number}", None)
    ends = [one["end"] for one in hunt.flown]
    print(
        json.dumps(
            {"landings": len(ends), "failures": len(failures), "ends": {e: ends.count(e) for e in set(ends)}}
        )
    )
    return int(bool(failures))


def _plant(own: argparse.Namespace) -> int:
    missed = 0
    for name in own.weakness:
        started_s = time.process_time()
        hunt = Hunt(
            own.out / f"{name}.jsonl",
            Flier(COARSE, WEAKNESSES[name]),
            own.seed,
            own.jobs,
            confirm=_is_safe_without,
        )
        found = hunt.run(own.landings)
        line: dict[str, Any] = {"weakness": name, "found": bool(found), "landings": len(hunt.flown)}
        line["cpu_s"] = round(sum(one["cpu_s"] for one in hunt.flown), 1)
        line["unsafe_without_it"] = sum(is_failure(one) and not one["failure"] for one in hunt.flown)
        if found:
            line["minimal"] = _keep(own, found[0], name, name).changed()
        line["cpu_s_with_shrinking"] = round(line["cpu_s"] + time.process_time() - started_s, 1)
        missed += not found
        print(json.dumps(line), flush=True)
    return int(bool(missed))


def _is_safe_without(scenario: Scenario) -> bool:
    """Return whether the program as it is flies a scenario safely, so that a weakness makes it unsafe."""
    return not coarsely(scenario).unsafe


def _keep(own: argparse.Namespace, scenario: Scenario, name: str, weakness: str | None) -> Scenario:
    """Shrink a failure and write it, once; return the minimal scenario."""
    path = own.out / "failures" / f"{name}.json"
    made_of = {"found": scenario.changed(), "detail": coarsely.detail, "program": program_version()}
    if path.exists() and made_of.items() <= read_object(path).items():
        return read(path)
    planted = Flier(COARSE, None if weakness is None else WEAKNESSES[weakness])

    def fails(one: Scenario) -> bool:
        outcome = planted(one)
        return outcome.unsafe and outcome.end != TAKEN and (weakness is None or _is_safe_without(one))

    minimal = shrink(scenario, fails, own.flights_to_shrink)
    path.parent.mkdir(parents=True, exist_ok=True)
    document = {"scenario": minimal.changed(), "weakness": weakness} | made_of
    document["outcome"] = asdict(planted(minimal))
    path.write_text(json.dumps(document, indent=1) + "\n", "utf-8")
    return minimal


def _count(own: argparse.Namespace) -> int:
    path = own.out / ("planted_landings.json" if own.planted else "cheap_landings.json")
    found = counts.count(
        path,
        own.landings,
        Flier(COARSE, all_at_once) if own.planted else Flier(CHEAP),
        own.seed,
        uniform if own.planted else one_trouble,
        own.jobs,
    )
    line = {name: found[name] for name in ("landings", "ends", "least_margin", "cpu_s")}
    if own.planted:
        line["by_a_weakness"] = [
            one["number"]
            for one in found["unsafe"]
            if one["end"] == UNSAFE and _is_safe_without(Scenario.of(**one["scenario"]))
        ]
        print(json.dumps(line))
        return int(bool(line["by_a_weakness"]))
    (own.out / "counts.json").write_text(json.dumps(counts.evidence(found)) + "\n", "utf-8")
    print(json.dumps(line))
    return int(found["ends"]["unsafe"] > 0)


def _equal(own: argparse.Namespace) -> int:
    found = equality.compare(own.out / "equal.jsonl", own.scenarios)
    print(json.dumps(found, indent=1))
    return int(found["equal"] < found["scenarios"])


def _model(own: argparse.Namespace) -> int:
    for name in own.weakness:
        flights = sorted(_flights_to_find(name, seed, own.landings) for seed in range(own.hunts))
        found = [n for n in flights if n <= own.landings]
        line = {"weakness": name, "hunts": own.hunts, "found": len(found), "median": flights[own.hunts // 2]}
        print(json.dumps(line | {"mean": round(sum(flights) / own.hunts)}), flush=True)
    return 0


def _flights_to_find(name: str, seed: int, budget: int) -> int:
    """Return how many modelled flights a hunt takes; one more than the budget if it finds nothing."""
    planted = Flier(COARSE, fly=lambda scenario, *_, **__: FlightModel(scenario, name).outcome())
    with tempfile.TemporaryDirectory() as folder:
        hunt = Hunt(
            Path(folder) / "model.jsonl",
            planted,
            seed,
            confirm=lambda scenario: not FlightModel(scenario, None).outcome().unsafe,
        )
        return len(hunt.flown) if hunt.run(budget) else budget + 1


def _replay(own: argparse.Namespace) -> int:
    scenario = read(own.file)
    kept = read_object(own.file)
    detail = own.detail or kept.get("detail", CHEAP)
    if not (isinstance(detail, str) and detail in DETAILS):
        raise InputError(f"{own.file}: there is no detail {detail!r}, only {', '.join(DETAILS)}")
    name = own.weakness or kept.get("weakness")
    if name is not None and not (isinstance(name, str) and name in WEAKNESSES):
        raise InputError(f"{own.file}: there is no weakness {name!r}, only {', '.join(WEAKNESSES)}")
    outcome = fly(scenario, detail, weakness=WEAKNESSES[name] if name else None)
    print(json.dumps(asdict(outcome), indent=1))
    return int(outcome.unsafe)


if __name__ == "__main__":
    main()
