"""Circle on a ground station's map: only around ground that is known to be safe now."""

from __future__ import annotations

import math
from dataclasses import replace
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from companion.flight.landing.situation import Situation
from companion.flight.outputs.map_circle import MapCircle, landing_circle
from params import Parameters
from slz import LandingPoint, LocalFrame, PointState, SurfaceHere

FRAME = LocalFrame(47.4, 8.5, 500.0)
BEST = LandingPoint(np.array([30.0, -20.0, 4.0]), 6.5, 9.0, 2.0, 0.99, surface=SurfaceHere())


def selected(state: PointState, height_m: float = 2.0) -> Any:
    return SimpleNamespace(enu_m=np.array([5.0, 6.0, 99.0]), height_m=height_m, state=state)


def circle(*points: LandingPoint, lidar_ok: bool = True, reported: Any = None, now: Any = None) -> Any:
    """Return the circle with zones of these best points; `now` is the selected point with what came on it."""
    zones = tuple(SimpleNamespace(best=point) for point in points)
    report = SimpleNamespace(frame=FRAME, zones=zones, selected=reported)
    situation = SimpleNamespace(report=report, selected=reported if now is None else now, lidar_ok=lidar_ok)
    return landing_circle(cast(Situation, situation), Parameters(touchdown_error_m=0.5, footprint_m=3.0))


def at(enu_m: tuple[float, float, float], drawn: MapCircle) -> bool:
    place = FRAME.enu_m(drawn.lat_deg, drawn.lon_deg, drawn.alt_m)
    return bool(np.allclose(place, enu_m, atol=0.01))


def test_without_a_selection_the_best_point_has_the_largest_circle_of_its_zone() -> None:
    drawn = circle(BEST, replace(BEST, enu_m=np.zeros(3)))
    assert at((30.0, -20.0, 4.0), drawn)
    assert drawn.radius_m == 6.5


def test_a_safe_selection_has_the_circle_that_was_judged() -> None:
    drawn = circle(BEST, reported=selected(PointState.SAFE))
    assert at((5.0, 6.0, 2.0), drawn)
    assert drawn.radius_m == 2.0


@pytest.mark.parametrize("state", [PointState.UNSAFE, PointState.UNKNOWN])
def test_a_selection_that_is_not_safe_has_none_and_the_best_point_does_not_take_its_place(
    state: PointState,
) -> None:
    assert circle(BEST, reported=selected(state)) is None
    assert circle(BEST, reported=selected(PointState.SAFE), now=selected(state)) is None


@pytest.mark.parametrize(
    "changed",
    [
        {"certainty": 0.5},
        {"certainty": math.nan},
        {"headings_deg": ()},
        {"clearance_m": 0.0},
        {"clearance_m": math.nan},
        {"enu_m": np.array([0.0, math.nan, 0.0])},
    ],
    ids=str,
)
def test_a_point_that_would_not_be_chosen_is_not_drawn(changed: dict[str, Any]) -> None:
    assert circle(replace(BEST, **changed)) is None


def test_ground_to_be_confirmed_is_passed_over() -> None:
    roof = replace(BEST, surface=cast(SurfaceHere, SimpleNamespace(must_be_confirmed=lambda *_: True)))
    assert circle(roof) is None
    assert at((30.0, -20.0, 4.0), circle(roof, BEST))


def test_without_a_fresh_map_nothing_is_drawn() -> None:
    assert circle() is None
    assert circle(BEST, lidar_ok=False) is None
    nothing = SimpleNamespace(report=None, selected=selected(PointState.SAFE), lidar_ok=True)
    assert landing_circle(cast(Situation, nothing), Parameters()) is None
    assert circle(reported=selected(PointState.SAFE, math.nan)) is None
