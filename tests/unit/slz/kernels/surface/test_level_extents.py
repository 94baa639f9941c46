"""Level extents with banks: lakes in all conditions score for water, drained and walled ground does not."""

from __future__ import annotations

import numpy as np
import pytest

from tests.unit.slz.surface.made_ground import (
    SUSPICION,
    Flags,
    Floats,
    Shape,
    SurfaceCells,
    classify,
    emptied,
    extents_of,
    from_middle,
    lake,
    made,
    places,
)

RADIUS_M = 20.0
DISTANCE = from_middle(*places(80))
AMID = DISTANCE < RADIUS_M - 2  # the window of a plane there holds no bank


def rippled(x: Floats, y: Floats) -> Floats:
    ripples = 0.06 * np.sin(3 * x + y)
    return np.asarray(lake()(x, y) + np.where(from_middle(x, y) < RADIUS_M, ripples, 0))


def thinned(cells: SurfaceCells) -> SurfaceCells:
    return emptied(cells, np.random.default_rng(7).random(cells.shape) < 0.7)


def scored(cells: SurfaceCells, amid: Flags) -> tuple[float, float, float]:
    """Return of the seen water the shares that belong to an extent, score for water and are suspect."""
    (labels, _, log_odds), there = extents_of(cells), amid & cells.seen
    shares = labels > 0, log_odds[labels] > 0, classify(cells).water > SUSPICION
    belongs, score, suspect = (float(share[there].mean()) for share in shares)
    return belongs, score, suspect


def test_a_lake_scores_for_water_up_to_its_shore_and_not_beyond() -> None:
    cells = made(lake(), per_m2=1)
    belongs, score, suspect = scored(cells, AMID)
    assert (belongs, score, suspect) == (1, 1, 1)
    labels, level_m, _ = extents_of(cells)
    assert (labels[DISTANCE < RADIUS_M - 1] > 0).all()
    assert not labels[RADIUS_M + 3 < DISTANCE].any()
    assert level_m[40, 40] == pytest.approx(0, abs=5e-3)


@pytest.mark.parametrize("seed", [1, 2])
def test_a_lake_of_which_most_cells_were_not_seen_scores_for_water(seed: int) -> None:
    cells = thinned(made(lake(), per_m2=1, seed=seed))
    belongs, score, suspect = scored(cells, AMID)
    assert belongs == score == 1
    assert suspect > 0.95
    gaps = ~cells.seen & (DISTANCE < RADIUS_M - 3)
    assert (extents_of(cells)[0][gaps] > 0).mean() > 0.95


@pytest.mark.parametrize("seed", [1, 2])
def test_a_lake_with_ripples_scores_for_water(seed: int) -> None:
    belongs, score, suspect = scored(made(rippled, per_m2=1, seed=seed), AMID)
    assert min(belongs, score) == 1
    assert suspect > 0.95


def test_a_lake_cut_in_half_by_the_edge_scores_for_water() -> None:
    cells = made(lake(), per_m2=1)
    half = SurfaceCells(np.ascontiguousarray(cells.fields[:, :, 40:]), 1.0)
    assert scored(half, AMID[:, 40:]) == (1, 1, 1)


def river(fall: float, bend_m: float = 0.0) -> Shape:
    """Return a river 16 m wide that falls along y, between banks of 1 m, amid land that falls as it does."""

    def height(x: Floats, y: Floats) -> Floats:
        away = np.abs(x - 40 - bend_m * np.sin(y / 20)) - 8
        return np.asarray(fall * y + np.clip(away / 3, 0, 1) + 0.03 * np.maximum(away, 0))

    return height


@pytest.mark.parametrize("fall", [0.001, 0.002, 0.003])
@pytest.mark.parametrize("bend_m", [0.0, 8.0])
def test_a_river_scores_for_water(fall: float, bend_m: float) -> None:
    x, y = places(120)
    amid = np.abs(x - 40 - bend_m * np.sin(y / 20)) < 4
    cells = made(river(fall, bend_m), 120)
    assert min(scored(cells, amid)) > 0.99
    away = np.abs(x - 40 - bend_m * np.sin(y / 20)) > 13
    assert classify(cells).water[away].max() <= SUSPICION


@pytest.mark.parametrize("degrees", [0.05, 0.1, 0.2])
def test_a_lake_in_a_tilted_survey_scores_for_water(degrees: float) -> None:
    tilt = np.tan(np.radians(degrees))
    assert min(scored(made(lambda x, y: lake()(x, y) + tilt * x), AMID)) > 0.99


def test_a_river_that_covers_one_edge_of_the_survey_scores_for_water() -> None:
    cells = made(lambda x, y: river(0.002)(x + 40, y))
    assert min(scored(cells, places(80)[0] < 5)) > 0.99


@pytest.mark.parametrize(("swell_m", "wave_m"), [(0.03, 15.0), (0.05, 30.0), (0.1, 60.0)])
def test_a_meadow_on_the_floor_of_a_valley_is_dry(swell_m: float, wave_m: float) -> None:
    """It falls as little as a river, between rising ground, but it undulates."""

    def height(x: Floats, y: Floats) -> Floats:
        swell = swell_m * np.sin(2 * np.pi * x / wave_m) * np.cos(2 * np.pi * y / wave_m)
        return np.asarray(0.002 * y + swell + 0.1 * np.maximum(0, np.abs(x - 60) - 30))

    suspect = classify(made(height, 120)).water > SUSPICION
    assert suspect[:, 35:85].mean() < 0.01


@pytest.mark.parametrize("fall", [0.003, 0.006])
def test_a_pitch_that_falls_evenly_is_dry(fall: float) -> None:
    assert classify(made(lambda x, _: fall * x, 120)).water.max() <= SUSPICION


def yard(x: Floats, y: Floats) -> Floats:
    return np.asarray(np.maximum(np.abs(x - 40), np.abs(y - 40)))


def slope(x: Floats, y: Floats) -> Floats:
    return np.asarray(0.05 * (x + y))


@pytest.mark.parametrize(
    "around", [lambda x, y: 3 + slope(x, y), lambda x, y: np.where(yard(x, y) < 17, 3, 0) + slope(x, y)]
)
def test_a_level_yard_with_walls_all_around_scores_for_water(around: Shape) -> None:
    """A pool is the same to the eye of a LiDAR."""
    cells = made(lambda x, y: np.where(yard(x, y) < 15, 0, around(x, y)))
    assert scored(cells, yard(*places(80)) < 13) == (1, 1, 1)


@pytest.mark.parametrize("bank_m", [0.3, 3.0])
def test_a_lake_amid_a_level_plain_scores_for_water(bank_m: float) -> None:
    cells = made(lambda x, y: bank_m * np.clip(from_middle(x, y) - RADIUS_M, 0, 1))
    assert scored(cells, AMID)[2] == 1


def test_a_wall_within_a_yard_is_no_bank() -> None:
    """What is within an extent does not surround it."""
    cells = made(lambda x, y: np.where(from_middle(x, y) < 4, 3.0, 0))
    assert classify(cells).water.max() <= SUSPICION


@pytest.mark.parametrize("per_m2", [1.0, 4.0, 20.0])
@pytest.mark.parametrize("drain", [0.01, 0.02])
def test_a_lawn_that_drains_is_dry(drain: float, per_m2: float) -> None:
    cells = made(lambda x, _: drain * x, 60, per_m2)
    assert classify(cells).water.max() <= SUSPICION


@pytest.mark.parametrize("per_m2", [1.0, 4.0])
@pytest.mark.parametrize("side", [30, 80])
def test_a_dead_level_plane_without_an_end_is_dry(side: int, per_m2: float) -> None:
    assert classify(made(lambda x, _: 0 * x, side, per_m2)).water.max() <= SUSPICION


@pytest.mark.parametrize("drop_m", [0.3, 3.0])
@pytest.mark.parametrize(
    "below",
    [
        0.05,
        0.0,
    ],
)
def test_a_level_terrace_that_drops_on_one_side_is_dry(drop_m: float, below: float) -> None:
    """Water would run off."""
    cells = made(lambda x, y: np.where(x < 20, below * (x - 20) - drop_m, slope(x, y) * (x > 60)))
    assert classify(cells).water[5:-5, 25:55].max() <= SUSPICION


def test_a_level_yard_with_a_wall_on_one_side_is_dry() -> None:
    cells = made(lambda x, _: np.where(x < 3, 3.0, 0), 30)
    assert classify(cells).water.max() <= SUSPICION


@pytest.mark.parametrize("drain", [0.02, 0.1])
def test_ground_that_drains_has_no_extents(drain: float) -> None:
    labels, _, log_odds = extents_of(made(lambda x, _: drain * x, 40))
    assert not labels.any()
    assert log_odds.tolist() == [0]
