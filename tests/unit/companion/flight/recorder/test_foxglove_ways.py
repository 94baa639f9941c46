"""Ways in and out and the wind in Foxglove's scene."""

from __future__ import annotations

import math
import re
from dataclasses import replace

import numpy as np
import pytest

from companion.flight.geometry.wind import Wind
from companion.flight.recorder.foxglove_scene import scene
from slz import SAFE, UNKNOWN, UNSAFE, Corridors, Report
from tests.unit.companion.flight.landing.flight import Flight

POINT = np.array([5.0, 0.0, 0.0])
WIND = Wind(math.radians(90), 6.0, 8.0, "autopilot")
NUMBER = r"(-?[\d.e-]+)"


def report(*, judged: bool) -> Report:
    """Return a report whose point has a mast 20 m north of it, and unseen air 5 degrees east of that."""
    flight = Flight([])
    flight.selected = POINT
    found = flight.situation().report
    assert found is not None
    assert found.selected is not None
    states, tops = np.full((72, 3), SAFE, np.uint8), np.full((72, 3), np.nan)
    states[0, :2], tops[0], states[1, :2] = UNSAFE, (5.0, 20.0, 12.0), UNKNOWN
    ways = Corridors(POINT, (30.0, 60.0, 90.0), states, np.zeros(72), tops)
    return replace(found, selected=replace(found.selected, corridors=ways if judged else None))


def ends(text: str) -> list[tuple[float, ...]]:
    """Return the ends of the lines from the point."""
    found = re.findall(rf"Point3 {{ x: {NUMBER}, y: {NUMBER}, z: {NUMBER} }}", text)
    return [tuple(map(float, one)) for one in found[1::2]]


def test_a_line_a_bearing_leads_up_a_clear_way_or_to_what_blocks_it() -> None:
    north, beside, third, *rest = ends(repr(scene(report(judged=True), 1)))
    assert north == (5.0, 20.0, 12.0)
    assert beside[2] == 0.0
    assert third[2] == pytest.approx(10 * math.sin(math.radians(30)))
    assert len(rest) == 69


def test_the_wind_s_arrow_comes_from_upwind_and_points_where_it_blows() -> None:
    text = repr(scene(report(judged=True), 1, WIND))
    assert 'text: "wind 6.0 m/s"' in text
    arrow = text[text.index("ArrowPrimitive {") :]
    x, y = map(float, re.findall(rf"Vector3 {{ x: {NUMBER}, y: {NUMBER}", arrow)[0])
    assert (x, y) == pytest.approx((19.0, 0.0), abs=1e-9)  # 14 m east of the point
    z, w = map(float, re.findall(rf"Quaternion {{ x: 0.0, y: 0.0, z: {NUMBER}, w: {NUMBER} }}", arrow)[0])
    turn = 2 * math.atan2(z, w)  # of an arrow that points east, anticlockwise
    assert (math.cos(turn), math.sin(turn)) == pytest.approx((-1.0, 0.0), abs=1e-9)


def test_what_is_not_known_is_not_drawn() -> None:
    text = repr(scene(report(judged=False), 1, None))
    assert "ways in and out" not in text
    assert "ArrowPrimitive" not in text
