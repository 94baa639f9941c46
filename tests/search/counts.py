"""Counts of evenly drawn landings, kept in one JSON file that a later run adds to, and as evidence."""

from __future__ import annotations

import json
import math
import time
from collections.abc import Callable, Set
from pathlib import Path
from typing import Any

import numpy as np

from companion.desk.evidence.landing_counts import counts_document
from companion.runtime.program_version import program_version
from tests.search.flight import ENDS, UNSAFE, Outcome
from tests.search.flights import Flier, flying
from tests.search.flown_file import InputError, read_object
from tests.search.scenario import Scenario, one_trouble

KEEP_EVERY = 10
FLIGHTS_OF_A_SEED = 10**7  # numbers of the flights of one seed, for `slz evidence`


Draw = Callable[[np.random.Generator], Scenario]


def count(
    path: Path,
    landings: int,
    flier: Flier,
    seed: int = 1,
    draw: Draw = one_trouble,
    jobs: int = 1,
) -> dict[str, Any]:
    """Fly drawn landings from the number that the file ends with, up to so many in all; return the counts.

    jobs: processes that fly; with more than one, `flier` must be picklable.

    Raises
    ------
    InputError
        The file was counted by another version of the program, with another seed or another flight, or is
        damaged.
    """
    counts = _read(path, seed, flier)
    scenarios = [numbered(counts["seed"], number, draw) for number in range(counts["landings"], landings)]
    with flying(flier, jobs) as fly_all:
        for scenario, outcome in zip(scenarios, fly_all(scenarios), strict=True):
            _add(counts, scenario, outcome)
            if counts["landings"] % KEEP_EVERY == 0 or counts["landings"] == landings:
                _write(path, counts)
    return counts


def numbered(seed: int, number: int, draw: Draw = one_trouble) -> Scenario:
    """Return the scenario of a number; the same number is the same scenario."""
    return draw(np.random.default_rng([seed, number]))


def _read(path: Path, seed: int, flier: Flier) -> dict[str, Any]:
    """Return the counts of a file, or those before the first landing."""
    if path.exists():
        found = read_object(path)
        own = {"program": program_version(), "seed": seed} | flier.head
        says = {name: found.get(name) for name in own}
        if says != own:
            raise InputError(
                f"{path} was counted by another version of the program, with another seed or another"
                f" flight: it says {says}, this is {own}: use another folder"
            )
        if not _agree(found, _nothing(seed, flier).keys()):
            raise InputError(f"{path} is damaged, its counts do not agree: use another folder")
        return found
    return _nothing(seed, flier)


def _nothing(seed: int, flier: Flier) -> dict[str, Any]:
    """Return the counts before the first landing."""
    return {
        "kind": f"{flier.detail} landings",
        "program": program_version(),
        "seed": seed,
        **flier.head,
        "landings": 0,
        "ends": dict.fromkeys(ENDS, 0),
        "by_hazard": {},
        "by_fault": {},
        "unsafe": [],
        "least_margin": 1.0,
        "cpu_s": 0.0,
        "updated": "",
    }


def _agree(counts: dict[str, Any], fields: Set[str]) -> bool:
    """Return whether counts are whole: all fields, and each table adds up to the landings."""
    if counts.keys() != fields:
        return False
    try:
        sums = [sum(counts["ends"][end] for end in ENDS)] + [
            sum(row[end] for row in counts[table].values() for end in ENDS)
            for table in ("by_hazard", "by_fault")
        ]
        margins = float(counts["least_margin"]), float(counts["cpu_s"])
        n_unsafe = sum(one["margin"] < 0 for one in counts["unsafe"])
    except (AttributeError, KeyError, TypeError, ValueError):
        return False
    landings = counts["landings"]
    whole = isinstance(landings, int) and all(found == landings for found in sums)
    return whole and all(map(math.isfinite, margins)) and counts["ends"][UNSAFE] <= n_unsafe


def _add(counts: dict[str, Any], scenario: Scenario, outcome: Outcome) -> None:
    counts["landings"] += 1
    counts["ends"][outcome.end] += 1
    for table, name in (("by_hazard", "hazard"), ("by_fault", "fault")):
        row = counts[table].setdefault(scenario.text(name), dict.fromkeys(ENDS, 0))
        row[outcome.end] += 1
    if outcome.unsafe:
        counts["unsafe"].append(
            {
                "number": counts["landings"] - 1,
                "end": outcome.end,
                "margin": outcome.margin,
                "parts": outcome.parts,
            }
            | {"scenario": dict(scenario.values)}
        )
    counts["least_margin"] = min(counts["least_margin"], outcome.margin)
    counts["cpu_s"] = round(counts["cpu_s"] + outcome.cpu_s, 2)


def _write(path: Path, counts: dict[str, Any]) -> None:
    counts["updated"] = time.strftime("%Y-%m-%dT%H:%M:%SZ", time.gmtime())
    path.parent.mkdir(parents=True, exist_ok=True)
    unfinished = path.with_suffix(".unfinished")
    unfinished.write_text(json.dumps(counts, indent=1) + "\n", "utf-8")
    unfinished.replace(path)


def evidence(counts: dict[str, Any]) -> dict[str, Any]:
    """Return the counts as `slz evidence` reads them."""
    first = counts["seed"] * FLIGHTS_OF_A_SEED
    hazards = {name: ends for name, ends in counts["by_hazard"].items() if name != "none"}
    return counts_document("search", [(first, first + counts["landings"])], counts["ends"], hazards)
