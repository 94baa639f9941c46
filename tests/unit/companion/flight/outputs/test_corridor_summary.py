"""Summary of ways in and out for JSON."""

from __future__ import annotations

import json

import numpy as np
import pytest

from companion.flight.outputs.report_summary import corridor_summary
from slz import SAFE, UNKNOWN, UNSAFE, Corridors

NONE = np.full((72, 3), np.nan)


def corridors(sloped: int, overhead: int) -> Corridors:
    """Return corridors of one state on all slopes, and of another straight down."""
    states = np.full((72, 3), sloped, np.uint8)
    states[:, -1] = overhead
    return Corridors(np.zeros(3), (30.0, 60.0, 90.0), states, np.zeros(72), NONE)


@pytest.mark.parametrize(
    ("sloped", "overhead", "state", "down"),
    [
        (SAFE, SAFE, "clear", "clear"),
        (UNKNOWN, SAFE, "clear", "clear"),
        (UNKNOWN, UNSAFE, "unknown", "blocked"),
        (UNSAFE, UNKNOWN, "unknown", "unknown"),
        (UNSAFE, UNSAFE, "blocked", "blocked"),
    ],
)
def test_the_best_way_and_that_straight_down_are_told(
    sloped: int, overhead: int, state: str, down: str
) -> None:
    told = corridor_summary(corridors(sloped, overhead))["corridors"]
    assert (told["state"], told["overhead"]) == (state, down)
    assert told["bearings_deg"] == (list(range(0, 360, 5)) if sloped == SAFE else [])


def test_clear_bearings_are_whole_degrees_clockwise_from_north() -> None:
    found = corridors(int(UNSAFE), int(SAFE))
    found.states[18, 1] = SAFE
    assert json.loads(json.dumps(corridor_summary(found)))["corridors"]["bearings_deg"] == [90]


def test_no_way_was_judged() -> None:
    assert corridor_summary(None) == {"corridors": None}
