"""Outlier removal: where an object would not be isolated."""

from __future__ import annotations

import numpy as np
import pytest

from params import Parameters
from slz.frame import LocalFrame
from slz.points.outliers import is_dense_at, not_isolated
from slz.stages.point_stages import Isolation, RangeGate
from slz.window import Window
from slz.window_returns import Flag, Returns

N_RETURNS = 100_000
SENSOR = np.array([10.0, 20.0, 30.0])


@pytest.mark.parametrize(("down_m", "dense"), [(4.44, True), (4.48, False)])
def test_near_the_sensor_an_object_would_send_back_two(down_m: float, dense: bool) -> None:
    """An object of 0.005 m2 sends back 0.005 x 100000 / (4 pi d2) of that many: two at 4.461 m."""
    point = SENSOR - np.array([[0.0, 0.0, down_m]])
    assert is_dense_at(point, SENSOR, N_RETURNS).tolist() == [dense]


def test_a_speck_at_the_sensor_is_alone_in_a_short_window_as_in_a_whole_one() -> None:
    """Two pulses hit it, as many as an object there would send back in a tenth of a window."""
    rng = np.random.default_rng(3)
    ground = (
        np.column_stack([rng.uniform(-15, 15, (1000, 2)), rng.normal(0, 0.02, 1000)]) + SENSOR - [0, 0, 18]
    )
    specks = SENSOR + np.array([[0.58, -0.2, -0.11], [0.5, -0.32, -0.1]])
    points = np.concatenate([ground, specks])
    assert not_isolated(points, SENSOR, 0.2)[-2:].all()
    assert not not_isolated(points, SENSOR, 0.2, looks=10)[-2:].any()
    assert (not_isolated(points, SENSOR, 0.2, looks=10) == not_isolated(points, SENSOR, 0.2))[:-2].all()


def window(clutter: int, span_s: float) -> Returns:
    """Returns of ground that are far from each other, and of clutter in the air, in one window."""
    rng = np.random.default_rng(4)
    up = np.concatenate([rng.normal(0, 0.02, 300), rng.uniform(3, 9, clutter)]) + SENSOR[2] - 18
    points = np.column_stack([rng.uniform(-40, 40, (len(up), 2)) + SENSOR[:2], up])
    stamps = np.linspace(0, span_s * 1e9, len(up)).astype(np.int64)
    home = LocalFrame(47.0, 8.0, 500.0)
    return Returns.of(Window(points, stamps, SENSOR, home, int(stamps[0]), int(stamps[-1])))


@pytest.mark.parametrize(("span_s", "kept"), [(1.0, True), (0.5, True), (0.1, False)])
def test_the_far_map_takes_returns_that_are_alone_where_the_sensor_has_few_and_not_the_window(
    span_s: float, kept: bool
) -> None:
    """Else dust would be walls, in which no way is free."""
    returns = window(30, span_s)
    for stage in (RangeGate(), Isolation()):
        stage.run(returns, Parameters())
    assert bool((returns.flags[-30:] & np.uint16(Flag.KEPT)).any()) == kept
