"""Equality of cheap and full flights: the same scenarios by both, and how their outcomes differ."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from tests.search.counts import numbered
from tests.search.flight import ABORTED, CHEAP, DETAILS, FULL, REFUSED, SAFE, TAKEN, UNSAFE, fly
from tests.search.flown_file import FlownFile

SEED = 46
NOT_LANDED = (ABORTED, REFUSED)
BORDER = 0.05  # a margin this near to zero is at the limit: noise decides on which side


def compare(path: Path, scenarios: int) -> dict[str, Any]:
    """Fly what is missing of so many scenarios by both evaluators; return the figures.

    Two outcomes are equal if both are landings, or both are none, and both are unsafe, or both are not.
    """
    head = {"search": "equal", "seed": SEED, CHEAP: DETAILS[CHEAP]}
    file = FlownFile(path, head, ("number", CHEAP, FULL))
    for number in range(len(file.flown), scenarios):
        scenario = numbered(SEED, number)
        both = {detail: asdict(fly(scenario, detail)) for detail in (CHEAP, FULL)}
        file.add({"number": number} | both)
    return figures(file.flown)


def figures(flown: list[dict[str, Any]]) -> dict[str, Any]:
    """Return how many outcomes are equal, and the differences of the margins where both landed."""
    pairs = [(one["cheap"], one["full"]) for one in flown]
    both = [(c["margin"], f["margin"]) for c, f in pairs if c["touchdown"] and f["touchdown"]]
    off = np.abs(np.subtract(*np.array(both).T)) if both else np.zeros(0)
    return {
        "scenarios": len(pairs),
        "same_end": sum(c["end"] == f["end"] for c, f in pairs),
        "equal": sum(_verdict(c) == _verdict(f) for c, f in pairs),
        "same_safety": sum((c["margin"] < 0) == (f["margin"] < 0) for c, f in pairs),
        "unequal": [
            one["number"] for one, (c, f) in zip(flown, pairs, strict=True) if _verdict(c) != _verdict(f)
        ],
        "both_landed": len(both),
        "margin_off": {}
        if not both
        else {f"p{q}": round(float(np.percentile(off, q)), 3) for q in (50, 90, 100)},
        "cpu_s": {
            how: round(float(np.mean([one[how]["cpu_s"] for one in flown])), 2) for how in ("cheap", "full")
        },
        "ends": {
            how: {
                end: sum(one[how]["end"] == end for one in flown)
                for end in (SAFE, UNSAFE, *NOT_LANDED, TAKEN)
            }
            for how in ("cheap", "full")
        },
    }


def _verdict(outcome: dict[str, Any]) -> str:
    return "not landed" if outcome["end"] in NOT_LANDED else str(outcome["end"])
