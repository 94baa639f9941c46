"""Rays without a return: the cell where each met the ground, and how much it counts."""

from __future__ import annotations

import numpy as np
import pytest

from slz.kernels.surface.surface_record import (
    ANSWER_M,
    COUNT,
    FARTHEST_M,
    LOST_NEAR,
    LOST_OBLIQUE,
    LOST_SLANTED,
    REPORTED,
    SURE_M,
)
from tests.unit.slz.kernels.surface.surface_tiles import Floats, Tiles, seen_from

SENSOR = np.array([0.5, 50.5, 12.0])


def through(degrees: float, azimuth_deg: float = 0.0, sensor: Floats = SENSOR) -> Floats:
    """Return a point (1, 3) a metre away on a ray."""
    return seen_from(sensor, degrees, 1.0, azimuth_deg)[np.newaxis]


@pytest.mark.parametrize("ground_m", [-4.0, 0.0, 5.0])
@pytest.mark.parametrize(("degrees", "field"), [(20, LOST_SLANTED), (45, LOST_OBLIQUE)])
@pytest.mark.parametrize("azimuth_deg", [10, 100, 190, 300])
def test_a_lost_ray_counts_where_it_meets_ground_of_the_height_given(
    ground_m: float, degrees: float, field: int, azimuth_deg: float
) -> None:
    tiles = Tiles()
    assert tiles.lose(through(degrees, azimuth_deg), SENSOR, 3.0, ground_m) == 1
    drop = SENSOR[2] - ground_m
    met = seen_from(SENSOR, degrees, drop / np.cos(np.radians(degrees)), azimuth_deg)
    assert tiles.cell(met[0], met[1])[[field, REPORTED]].tolist() == [3, 1]
    assert tiles.pool[..., REPORTED].sum() == 1


def test_a_lost_ray_meets_a_cell_s_own_ground_where_it_is_known() -> None:
    """The ground is a metre higher than told, so a ray at 60 degrees meets it 1.7 m earlier."""
    tiles = Tiles()
    x, y = np.meshgrid(np.arange(0.5, 40), np.arange(30.5, 70))
    tiles.add(np.column_stack([x.ravel(), y.ravel(), np.ones(x.size)]))
    assert tiles.lose(through(60), SENSOR, ground_m=0.0) == 1
    assert tiles.cell(0.5 + 11 * np.sqrt(3), 50.5)[LOST_OBLIQUE] == 1
    assert tiles.cell(0.5 + 12 * np.sqrt(3), 50.5)[LOST_OBLIQUE] == 0


def test_weights_add_up() -> None:
    tiles = Tiles()
    rays = np.vstack([through(45)] * 5)
    assert tiles.lose(rays, SENSOR, 2.5) == 5
    assert tiles.cell(12.5, 50.5)[[LOST_OBLIQUE, REPORTED]].tolist() == [12.5, 5]


@pytest.mark.parametrize("range_m", [10.0, ANSWER_M - 0.1, ANSWER_M + 5, 2 * ANSWER_M, FARTHEST_M - 0.1])
def test_beyond_the_range_at_which_dark_ground_answers_a_ray_counts_by_the_square(range_m: float) -> None:
    sensor = np.array([-20.5, 50.5, range_m * np.cos(np.radians(40))])
    tiles = Tiles()
    assert tiles.lose(through(40, sensor=sensor), sensor) == 1
    share = min(1.0, (ANSWER_M / range_m) ** 2)
    assert tiles.pool[..., LOST_OBLIQUE].sum() == pytest.approx(share, rel=1e-5)
    assert tiles.pool[..., LOST_NEAR].sum() == (range_m <= SURE_M)


@pytest.mark.parametrize(
    ("degrees", "sensor", "ground_m"),
    [
        (91, SENSOR, 0.0), (90, SENSOR, 0.0), (135, SENSOR, 0.0),  # above the horizon
        (5, SENSOR, 0.0), (70, SENSOR, 0.0),  # too steep, too flat
        (45, SENSOR, 13.0),  # ground higher than the sensor
        (45, np.array([-60.5, 50.5, 0.75 * FARTHEST_M]), 0.0),  # too far
        (45, np.array([-129.0, 50.5, 12.0]), 0.0),  # no tile there
        (45, np.array([500.0, 50.5, 12.0]), 0.0),
        (45, np.full(3, np.nan), 0.0),
    ],
)  # fmt: skip
def test_a_ray_that_tells_nothing_of_the_ground_does_not_count(
    degrees: float, sensor: Floats, ground_m: float
) -> None:
    tiles = Tiles()
    assert tiles.lose(through(degrees, sensor=sensor), sensor, ground_m=ground_m) == 0
    assert not tiles.pool.any()


def test_lost_rays_make_no_returns() -> None:
    tiles = Tiles()
    tiles.lose(through(45), SENSOR)
    assert not tiles.pool[..., COUNT].any()
