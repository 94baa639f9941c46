"""Steps of heights tell by how much a scan is shifted, and along an edge they tell nothing."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from companion.flight.fusion.odometry.step_map import StepMap
from tests.unit.companion.flight.fusion.odometry.worlds import Floats, near_ground, roofs, slope, terrace

World = Callable[[np.random.Generator], Floats]
LATER_NS = 11_000_000_000
SENSOR = np.array([0.0, 0.0, 15.0])


def mapped(world: World, about: Floats | None = None) -> StepMap:
    """A map of 30 scans, seen first at 1 s."""
    rng, steps = np.random.default_rng(1), StepMap()
    for k in range(30):
        points = world(rng)
        steps.add(points if about is None else points + about, 1_000_000_000 + k * 100_000_000)
    return steps


def scan_of(world: World) -> Floats:
    rng = np.random.default_rng(7)
    return np.concatenate([world(rng), world(rng)])


@pytest.fixture(scope="module")
def roofs_map() -> StepMap:
    return mapped(roofs)


@given(east=st.floats(-0.4, 0.4), north=st.floats(-0.4, 0.4))
@settings(max_examples=30, deadline=None)
def test_a_scan_over_roofs_is_shifted_back(roofs_map: StepMap, east: float, north: float) -> None:
    away = np.array([east, north, 0.0])
    shift, information, _ = roofs_map.shift(scan_of(roofs) + away, SENSOR, LATER_NS)
    assert np.abs(shift + away[:2]).max() < 0.06
    assert np.linalg.eigvalsh(information).min() > 1 / 0.1**2


def test_an_edge_tells_nothing_along_it() -> None:
    points = scan_of(terrace) + np.array([0.0, 0.2, 0.0])
    inside = points[np.abs(points[:, 0]) < 9]  # for the world ends beyond
    shift, information, _ = mapped(terrace).shift(inside, SENSOR, LATER_NS)
    assert abs(shift[1] + 0.2) < 0.06
    assert information[0, 0] < 1.0 < 100.0 < information[1, 1]


@pytest.mark.parametrize("world", [near_ground, slope])
def test_ground_without_steps_tells_nothing(world: World) -> None:
    assert not mapped(world).shift(scan_of(world), SENSOR, LATER_NS)[1].any()


def test_what_was_seen_just_now_tells_nothing() -> None:
    assert mapped(roofs).shift(scan_of(roofs), SENSOR, 4_000_000_000)[2] == 0


def test_a_scan_of_another_place_tells_nothing() -> None:
    elsewhere = scan_of(roofs) + np.array([4.0, 4.0, 0.0])
    assert not mapped(roofs).shift(elsewhere, SENSOR, LATER_NS)[1].any()


def test_steps_far_away_tell_less_for_the_heading_may_be_wrong() -> None:
    away = np.array([16.0, 0.0, 0.0])
    near = mapped(roofs).shift(scan_of(roofs), SENSOR, LATER_NS)[1]
    far = mapped(roofs, away).shift(scan_of(roofs) + away, SENSOR, LATER_NS)[1]
    assert far[1, 1] < near[1, 1] / 4
    assert far[0, 0] == pytest.approx(near[0, 0], rel=0.5)


def test_returns_from_below_the_ground_are_no_shadow() -> None:
    steps = mapped(near_ground)
    rng = np.random.default_rng(3)
    below = np.column_stack([rng.uniform(-12, 12, (200, 2)), np.full(200, -4.0)])
    steps.add(below, 4_500_000_000)
    assert not steps.shift(scan_of(near_ground), SENSOR, LATER_NS)[1].any()


def test_where_nothing_was_seen_there_is_no_shadow() -> None:
    step = np.array([-0.1, -0.1, 3.0])  # in the cell next to the origin, to the south-west
    steps, high = StepMap(), np.array([[0.5, 0.5, 3.0]] * 200) * np.random.default_rng(5).random((200, 3))
    high[:, 2] = 3.0
    for k in range(5):
        steps.add(high, 1_000_000_000 + k)
    assert steps.shift(np.repeat(step[np.newaxis], 100, axis=0) * (-1, -1, 1), SENSOR, LATER_NS)[2] == 0


def test_a_cleared_map_tells_nothing() -> None:
    steps = mapped(roofs)
    steps.clear()
    assert steps.shift(scan_of(roofs), SENSOR, LATER_NS)[2] == 0
