"""Ranges of bearings of the ways in and out, and what blocks the others."""

from __future__ import annotations

import json
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from companion.flight.outputs.corridor_ranges import corridor_ranges
from companion.flight.outputs.report_summary import corridor_summary
from slz import SAFE, UNKNOWN, UNSAFE, Corridors

SLOPES_DEG = (30.0, 60.0, 90.0)


def corridors(tops: dict[int, tuple[float, float, float]] | None = None, rest: int = SAFE) -> Corridors:
    """Return corridors of a point with tops (distance, height above the point, slope) by bearing."""
    states = np.full((72, 3), rest, np.uint8)
    least, obstacles = np.zeros(72), np.full((72, 3), np.nan)
    point = np.array([1.0, 2.0, 3.0])
    for bearing, (away, height, slope) in (tops or {}).items():
        angle, k = np.radians(bearing), bearing // 5
        states[k, 0], least[k] = UNSAFE, slope
        obstacles[k] = point + np.array([away * np.sin(angle), away * np.cos(angle), height])
    return Corridors(point, SLOPES_DEG, states, least, obstacles)


def place(bearing: int, top: NDArray[np.float64]) -> dict[str, Any]:
    return {"k": bearing, "east_m": round(float(top[0]), 1)}


def test_open_ground_is_one_clear_range() -> None:
    told = corridor_ranges(corridors(), place)
    assert told == {"slope_deg": 30.0, "clear_deg": [[0, 355]], "unknown_deg": [], "blocked": []}


def test_a_blocked_range_holds_the_top_that_asks_for_the_steepest_slope() -> None:
    tops = {80: (10.0, 5.0, 40.0), 85: (9.0, 6.0, 48.0), 90: (10.0, 5.0, 41.0)}
    told = corridor_ranges(corridors(tops, UNKNOWN), place)
    assert told["unknown_deg"] == [[95, 75]]
    assert told["blocked"] == [
        {
            "bearings_deg": [80, 90],
            "least_slope_deg": 48.0,
            "height_m": 6.0,
            "distance_m": 9.0,
            "k": 17,
            "east_m": 10.0,
        }
    ]


def test_a_range_across_north_is_one() -> None:
    told = corridor_ranges(corridors(dict.fromkeys((350, 355, 0, 5), (8.0, 9.0, 55.0))), place)
    assert [one["bearings_deg"] for one in told["blocked"]] == [[350, 5]]
    assert told["clear_deg"] == [[10, 345]]


def test_two_obstacles_side_by_side_are_two_ranges() -> None:
    tops = {40: (10.0, 8.0, 50.0), 45: (10.0, 8.0, 50.0), 50: (28.0, 20.0, 42.0), 55: (28.0, 20.0, 42.0)}
    blocked = corridor_ranges(corridors(tops), place)["blocked"]
    assert [(one["bearings_deg"], one["distance_m"]) for one in blocked] == [
        ([40, 45], 10.0),
        ([50, 55], 28.0),
    ]


def test_what_nothing_passes_over_asks_for_no_slope() -> None:
    (one,) = corridor_ranges(corridors({20: (1.0, 4.0, 90.0)}), place)["blocked"]
    assert one["least_slope_deg"] is None


def test_walls_all_around_leave_no_bearing() -> None:
    told = corridor_ranges(corridors({5 * k: (10.0, 8.0, 50.0) for k in range(72)}), place)
    assert [one["bearings_deg"] for one in told["blocked"]] == [[0, 355]]
    assert told["clear_deg"] == told["unknown_deg"] == []


@pytest.mark.parametrize(("north_deg", "first"), [(2.4, 82), (-81.2, 359)])
def test_bearings_are_turned_to_true_north_and_lengths_to_the_ground(north_deg: float, first: int) -> None:
    told = corridor_ranges(corridors({80: (10.0, 5.0, 40.0)}), place, north_deg=north_deg, length=0.5)
    assert told["blocked"][0]["bearings_deg"] == [first, first]
    assert told["blocked"][0]["distance_m"] == 5.0
    assert json.loads(json.dumps(told)) == told


# Summary of ways in and out for JSON.


NONE = np.full((72, 3), np.nan)


def two_corridors(sloped: int, overhead: int) -> Corridors:
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
    told = corridor_summary(two_corridors(sloped, overhead))["corridors"]
    assert (told["state"], told["overhead"]) == (state, down)
    assert told["bearings_deg"] == (list(range(0, 360, 5)) if sloped == SAFE else [])


def test_clear_bearings_are_whole_degrees_clockwise_from_north() -> None:
    found = two_corridors(int(UNSAFE), int(SAFE))
    found.states[18, 1] = SAFE
    assert json.loads(json.dumps(corridor_summary(found)))["corridors"]["bearings_deg"] == [90]


def test_no_way_was_judged() -> None:
    assert corridor_summary(None) == {"corridors": None}
