"""Returns of surface cells: statistics of heights, incidence, echoes, darkness and age."""

from __future__ import annotations

import numpy as np
import pytest

from slz.kernels.surface.add_returns import MOST_COUNT, MOST_DARK
from slz.kernels.surface.surface_record import (
    APART_M,
    ASIDE,
    ASIDE_DEG,
    ASIDE_LIGHT,
    ASIDE_M,
    COUNT,
    DARK,
    DARKEST,
    DEEP,
    HIGH,
    LOW,
    MEAN,
    NADIR,
    NADIR_DEG,
    NADIR_LIGHT,
    NADIR_M,
    NUMBERED,
    OBLIQUE,
    OBLIQUE_DEG,
    SEVERAL,
    SLANTED,
    SQUARES,
    TALL,
    TIME,
)
from tests.unit.slz.kernels.surface.surface_tiles import Floats, Tiles, seen_from

SENSOR = np.array([0.5, 50.5, 30.0])
UNDER = (0.5, 50.5)  # a cell's centre


def column(heights: Floats) -> Floats:
    """Return points of the cell under the sensor."""
    xy = np.random.default_rng(9).uniform(-0.49, 0.49, (len(heights), 2)) + UNDER
    return np.column_stack([xy, heights])


def test_count_mean_and_squares_are_those_of_each_cell_s_heights() -> None:
    rng = np.random.default_rng(1)
    tiles = Tiles()
    points = np.column_stack(
        [rng.uniform(-140, 80, 20_000), rng.uniform(0, 100, 20_000), rng.normal(4, 0.3, 20_000)]
    )
    tiles.add(points)
    place = np.floor(points[:, :2])
    inside = (place[:, 0] >= -66) & (place[:, 0] < 62) & (place[:, 1] >= 20) & (place[:, 1] < 84)
    assert tiles.pool[..., COUNT].sum() == np.count_nonzero(inside)
    for at in np.unique(place[inside], axis=0)[::50]:
        z = points[(place == at).all(axis=1), 2].astype(np.float32).astype(np.float64)
        found = tiles.cell(*at)[[COUNT, MEAN, SQUARES, LOW, HIGH]]
        expected = len(z), z.mean(), ((z - z.mean()) ** 2).sum(), z.min(), z.max()
        np.testing.assert_allclose(found, expected, rtol=1e-4, atol=1e-4)


def test_heights_far_from_the_mean_of_the_ones_before_are_deep_or_tall() -> None:
    tiles, near = Tiles(), 0.9 * APART_M
    tiles.add(column(np.array([1.0, 1.0 + near, 1.0 - near / 2])))
    assert not tiles.cell(*UNDER)[[DEEP, TALL]].any()
    tiles.add(column(np.array([1.0 + 1.2 * APART_M, 1.0 - 1.5 * APART_M, 1.0 - 1.5 * APART_M])))
    assert tiles.cell(*UNDER)[[DEEP, TALL]].tolist() == [2, 1]


def test_a_height_that_is_too_uncertain_counts_for_incidence_and_echoes_only() -> None:
    tiles = Tiles()
    tiles.add(column(np.zeros(3)), SENSOR - (30, 0, 0), np.zeros(3, np.bool_), echoes=np.array([1, 2, 1]))
    cell = tiles.cell(*UNDER)
    assert (cell[COUNT], cell[OBLIQUE], cell[NUMBERED], cell[SEVERAL]) == (0, 3, 3, 1)


@pytest.mark.parametrize(
    ("degrees", "slanted", "oblique"),
    [(0, 0, 0), (5.9, 0, 0), (6.1, 1, 0), (29.9, 1, 0), (30.1, 0, 1), (80, 0, 1), (150, 0, 1)],
)
@pytest.mark.parametrize("azimuth_deg", [0, 130, 270])
def test_incidence_makes_a_return_slanted_or_oblique(
    degrees: float, slanted: int, oblique: int, azimuth_deg: float
) -> None:
    tiles = Tiles()
    at = seen_from(SENSOR, degrees, 12, azimuth_deg)
    tiles.add(at[np.newaxis], SENSOR)
    assert tiles.cell(at[0], at[1])[[SLANTED, OBLIQUE]].tolist() == [slanted, oblique]


def test_without_the_sensor_s_place_no_incidence_counts() -> None:
    tiles = Tiles()
    tiles.add(column(np.zeros(5)))
    tiles.add(column(np.zeros(5)), np.full(3, np.nan))
    assert not tiles.cell(*UNDER)[[SLANTED, DARK]].any()
    assert tiles.cell(*UNDER)[COUNT] == 10


def test_echoes_count_where_their_number_is_known() -> None:
    tiles = Tiles()
    tiles.add(column(np.zeros(6)), echoes=np.array([0, 0, 1, 1, 2, 3]))
    tiles.add(column(np.zeros(6)))
    assert tiles.cell(*UNDER)[[NUMBERED, SEVERAL]].tolist() == [4, 2]


@pytest.mark.parametrize(
    ("degrees", "intensity", "told"),
    [
        (20, 0.5 * DARKEST, 1), (20, 2 * DARKEST, 0), (25, 2 * DARKEST, -1), (20, np.nan, 0),
        (10, 0.5 * DARKEST, 0),
        (70, 0.1 * DARKEST, 0), (60, 0.4 * DARKEST, 1), (60, 0.6 * DARKEST, -1),
    ],
)  # fmt: skip
def test_returns_darker_than_dry_ground_beside_nadir_are_dark(
    degrees: float, intensity: float, told: int
) -> None:
    """Seen at 60 degrees, a diffuse target sends back half as much."""
    tiles, at = Tiles(), seen_from(SENSOR, degrees, 12)
    tiles.add(at[np.newaxis], SENSOR, intensity=np.array([intensity]))
    assert tiles.cell(at[0], at[1])[DARK] == told


def test_a_few_newer_returns_outweigh_any_number_of_dark_ones() -> None:
    tiles, at = Tiles(), np.tile(seen_from(SENSOR, 25, 12), (1000, 1))
    tiles.add(at, SENSOR, intensity=np.zeros(1000))
    assert tiles.cell(at[0, 0], at[0, 1])[DARK] == MOST_DARK
    tiles.add(at, SENSOR, intensity=np.ones(1000))
    assert tiles.cell(at[0, 0], at[0, 1])[DARK] == -MOST_DARK


def test_a_cell_not_hit_for_too_long_begins_anew() -> None:
    tiles = Tiles()
    tiles.add(column(np.full(9, 3.0)), SENSOR - (30, 0, 0), now_s=10, max_age_s=5)
    tiles.add(column(np.full(2, 1.0)), now_s=15, max_age_s=5)
    assert tiles.cell(*UNDER)[[COUNT, OBLIQUE, TIME]].tolist() == [11, 9, 15]
    tiles.add(column(np.full(2, 1.0)), now_s=20.5, max_age_s=5)
    assert tiles.cell(*UNDER)[[COUNT, OBLIQUE, MEAN, TALL, TIME]].tolist() == [2, 0, 1, 0, 20.5]


def test_sums_of_very_many_returns_stay_exact_and_in_proportion() -> None:
    n = int(1.7 * MOST_COUNT)
    tiles, z = Tiles(), np.random.default_rng(3).normal(200, 0.05, int(1.7 * MOST_COUNT))
    tiles.add(column(z), SENSOR - (300, 0, -400), echoes=np.arange(n) % 4 + 1)
    cell = tiles.cell(*UNDER)
    assert cell[COUNT] <= MOST_COUNT
    assert cell[MEAN] == pytest.approx(200, abs=2e-3)
    assert np.sqrt(cell[SQUARES] / cell[COUNT]) == pytest.approx(0.05, rel=0.05)
    assert cell[SEVERAL] / cell[NUMBERED] == pytest.approx(0.75, abs=0.01)
    assert cell[OBLIQUE] == pytest.approx(cell[COUNT], rel=1e-3)


def test_points_that_are_nowhere_change_nothing() -> None:
    tiles = Tiles()
    astray = np.array([[np.nan, 30, 0], [0, np.inf, 0], [-129, 30, 0], [1e300, 30, 0], [0, 19.9, 0]])
    tiles.add(astray, SENSOR)
    assert not tiles.pool.any()


@pytest.mark.parametrize(
    ("degrees", "above", "aside"),
    [
        (0, 2, 0),
        (NADIR_DEG - 0.1, 2, 0),
        (NADIR_DEG + 0.1, 0, 0),
        (ASIDE_DEG - 0.1, 0, 0),
        (ASIDE_DEG + 0.1, 0, 2),
        (OBLIQUE_DEG - 0.1, 0, 2),
        (OBLIQUE_DEG + 0.1, 0, 0),
    ],
)
def test_heights_and_light_are_told_from_above_and_from_aside(degrees: float, above: int, aside: int) -> None:
    tiles = Tiles()
    at = seen_from(SENSOR, degrees, 12)
    points = np.array([at, at, at, at])
    points[1, 2] += 0.02
    near = np.array([True, True, True, False])
    tiles.add(points, SENSOR, near, np.array([0.1, 0.3, np.nan, 0.5]))
    cell = tiles.cell(*at[:2])
    assert (cell[NADIR], cell[ASIDE]) == (above, aside)
    for n, height, light in ((above, NADIR_M, NADIR_LIGHT), (aside, ASIDE_M, ASIDE_LIGHT)):
        if n:
            assert cell[height] == pytest.approx(at[2] + 0.01, abs=2e-3)
            assert cell[light] == pytest.approx(0.2)


def test_a_full_cell_keeps_its_mean_heights_and_light() -> None:
    tiles, n = Tiles(), int(MOST_COUNT) + 10
    points = np.tile([*UNDER, 1.0], (n, 1))
    tiles.add(points, SENSOR, intensity=np.full(n, 0.2))
    cell = tiles.cell(*UNDER)
    assert cell[COUNT] < MOST_COUNT
    assert cell[NADIR] < MOST_COUNT
    assert (cell[NADIR_M], cell[NADIR_LIGHT]) == pytest.approx((1.0, 0.2), rel=1e-3)
