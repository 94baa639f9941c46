"""Air between the sensor and its returns is seen; no other is."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

import params
from slz.air.seen_air import MOST_RAYS, SeenAir

STRAIGHT_UP = np.array([np.inf])
FLOOR = np.array([0.5, 0.5, 0.3])
RADIUS_M = 1.5


def ground(n: int, side_m: float = 12.0) -> NDArray[np.float64]:
    """Return returns (n, 3) scattered over level ground around the origin."""
    xy = np.random.default_rng(1).uniform(-side_m / 2, side_m / 2, (n, 2))
    return np.column_stack([xy, np.zeros(n)])


def is_unseen(air: SeenAir, ceiling_m: float, at: NDArray[np.float64] = FLOOR) -> bool:
    """Return whether the air straight above a place was not seen up to a height."""
    found = air.unseen(at, ceiling_m, STRAIGHT_UP, (RADIUS_M, 0.0, 2.0, 10.0), np.zeros((4, 1), bool))
    assert (found == found[0]).all()
    return bool(found[0, 0])


def looked_at(
    points: NDArray[np.float64], sensor_m: float = 20.0, datum_m: float = 0.0, windows: int = 1
) -> SeenAir:
    """Return the air that a sensor above the origin saw."""
    air, origin = SeenAir(params.load()), np.zeros(len(points), np.uint16)
    for _ in range(windows):
        air.add(points - (0, 0, datum_m), origin, np.array([[0.0, 0.0, sensor_m]]), datum_m)
    return air


def test_air_is_unseen_before_any_ray() -> None:
    assert is_unseen(SeenAir(params.load()), 5.0)


@pytest.mark.parametrize("n", [3_000, 3 * MOST_RAYS, 40 * MOST_RAYS])
def test_air_above_ground_is_seen_up_to_where_rays_diverge_enough(n: int) -> None:
    air = looked_at(ground(n))
    assert not is_unseen(air, 8.0)
    assert is_unseen(air, 19.5)


def test_a_few_rays_do_not_show_air() -> None:
    assert is_unseen(looked_at(ground(300)), 8.0)


def test_air_beside_the_returns_is_unseen() -> None:
    assert is_unseen(looked_at(ground(3_000)), 8.0, np.array([8.0, 0.5, 0.3]))


def test_air_behind_a_wall_is_unseen() -> None:
    """Rays to the ground beyond x = 0 end at a wall there."""
    points = ground(30_000, 24.0)
    beyond = points[:, 0] > 0.2
    share = 0.2 / points[beyond, 0]
    points[beyond] = share[:, None] * points[beyond] + (1 - share[:, None]) * (0, 0, 20.0)
    air = looked_at(points, windows=8)
    assert is_unseen(air, 8.0, np.array([6.0, 0.5, 0.3]))
    assert not is_unseen(air, 8.0, np.array([-6.0, 0.5, 0.3]))


@pytest.mark.parametrize("datum_m", [-3.0, 0.4, 7.0])
def test_a_datum_that_moved_with_the_estimate_changes_nothing(datum_m: float) -> None:
    assert not is_unseen(looked_at(ground(3_000), datum_m=datum_m), 8.0)


def test_a_sensor_at_an_unknown_place_shows_nothing() -> None:
    assert is_unseen(looked_at(ground(3_000), sensor_m=np.nan), 8.0)
