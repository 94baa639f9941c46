"""Classification of surface cells: probabilities, monotony in the evidence, and evidence that is absent."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from slz.kernels.surface.surface_record import (
    CANOPY,
    COUNT,
    DARK,
    KIND,
    LOST_NEAR,
    LOST_OBLIQUE,
    LOST_SLANTED,
    NUMBERED,
    OBLIQUE,
    RAISED,
    REPORTED,
    SEVERAL,
    SLANTED,
    SQUARES,
    WATER,
)
from slz.surface.surface_kinds import SurfaceKind
from tests.unit.slz.surface.made_ground import (
    SUSPICION,
    SurfaceCells,
    classify,
    emptied,
    from_middle,
    lake,
    made,
    places,
    with_fields,
)

SIDE = 4  # too small for an extent, and for water that floods its surroundings


def any_cells(seed: int, side: int = SIDE) -> SurfaceCells:
    """Return cells in which every field is at random, each with rays enough to decide."""
    rng = np.random.default_rng(seed)
    shape = side, side
    cells = made(
        lambda x, y: rng.uniform(-0.05, 0.05) * x + 3 * (y > side * rng.random()), side, 12, 0.03, seed
    )
    lost = rng.uniform(0, 9, (2, *shape))
    values = {
        SQUARES: cells.fields[COUNT] * rng.exponential(0.05, shape) ** 2,
        NUMBERED: cells.fields[COUNT],
        SEVERAL: cells.fields[COUNT] * rng.random(shape),
        SLANTED: rng.integers(0, 20, shape),
        OBLIQUE: rng.integers(4, 20, shape),
        LOST_SLANTED: lost[0],
        LOST_OBLIQUE: lost[1],
        REPORTED: 3 + lost.sum(axis=0),
        DARK: 20 * rng.normal(size=shape) * rng.integers(0, 2),
    }
    return emptied(with_fields(cells, values), rng.random(shape) < 0.1 * (seed % 3))


def any_shape(seed: int) -> np.ndarray[tuple[int, ...], np.dtype[np.float32]]:
    rng = np.random.default_rng(seed)
    return np.asarray(rng.uniform(-6, 6, (SIDE, SIDE)) * (rng.random((SIDE, SIDE)) < 0.5), np.float32)


@pytest.mark.parametrize("side", [SIDE, 30])
def test_probabilities_are_between_0_and_1_and_so_is_their_sum(side: int) -> None:
    for seed in range(40 if side == SIDE else 8):
        values = classify(any_cells(seed, side)).values
        parts = values[WATER : CANOPY + 1]
        assert np.isfinite(values).all()
        assert parts.min() >= 0
        assert parts.sum(axis=0).max() <= 1 + 1e-6
        assert set(np.unique(values[KIND])) <= set(SurfaceKind)


def test_cells_without_returns_are_unknown() -> None:
    cells = made(lambda x, _: 0.05 * x, 40)
    empty = from_middle(*places(40), 20) < 6
    values = classify(emptied(cells, empty)).values
    assert not values[: RAISED + 1, empty].any()
    assert not values[KIND, empty].any()
    nothing = classify(with_fields(cells, dict.fromkeys(range(len(cells.fields)), 0.0))).values
    assert not nothing.any()


def test_a_plain_slope_is_bare() -> None:
    layers = classify(made(lambda x, _: 0.05 * x, 30, 10))
    assert (layers.kind == SurfaceKind.BARE).all()
    assert layers.water.max() < 0.01


def test_more_lost_rays_never_lower_the_probability_of_water() -> None:
    for seed in range(200):
        cells, shape, rng = any_cells(seed), any_shape(seed), np.random.default_rng(seed + 1000)
        more = rng.integers(1, 9, cells.shape) * (rng.random(cells.shape) < rng.random())
        field = (LOST_OBLIQUE, LOST_SLANTED)[seed % 2]
        added = {field: cells.fields[field] + more, REPORTED: cells.fields[REPORTED] + more}
        before = classify(cells, None, shape).water
        assert (classify(with_fields(cells, added), None, shape).water >= before - 1e-6).all(), seed


def test_more_answered_oblique_rays_never_raise_it_where_nothing_is_dark() -> None:
    for seed in range(200):
        cells = with_fields(any_cells(seed), {DARK: 0.0})
        shape, rng = any_shape(seed), np.random.default_rng(seed + 1000)
        more = rng.integers(1, 9, cells.shape) * (rng.random(cells.shape) < rng.random())
        added = {OBLIQUE: cells.fields[OBLIQUE] + more}
        before = classify(cells, None, shape).water
        assert (classify(with_fields(cells, added), None, shape).water <= before + 1e-6).all(), seed


def test_dark_returns_never_lower_it_and_bright_ones_never_raise_it() -> None:
    for seed in range(100):
        cells = any_cells(seed)
        told = [classify(with_fields(cells, {DARK: dark})).water for dark in (-100.0, 0.0, 3.0, 100.0)]
        for less, more in itertools.pairwise(told):
            assert (more >= less - 1e-6).all(), seed


@pytest.mark.parametrize(
    "absent",
    [
        {DARK: 0.0},  # intensity absent
        {DARK: -100.0},  # saturated
        {NUMBERED: 0.0, SEVERAL: 0.0},  # numbers of echoes swapped: unknown
        {NUMBERED: 50.0, SEVERAL: 0.0},
    ],
)
def test_without_other_evidence_the_shape_decides(absent: dict[int, float]) -> None:
    for height in (lake(), lambda x, _: 0.01 * x, lambda x, _: 0 * x):
        cells = made(height, 80)
        verdict = classify(cells).values
        np.testing.assert_array_equal(classify(with_fields(cells, absent)).values, verdict)


def test_oblique_answers_acquit_a_level_yard_and_lost_ones_convict_a_lake() -> None:
    cells, amid = made(lake(), 80), from_middle(*places(80)) < 17
    assert classify(with_fields(cells, {OBLIQUE: 20.0})).water.max() <= SUSPICION
    lost = classify(with_fields(cells, {LOST_OBLIQUE: 20.0, REPORTED: 20.0}))
    assert lost.water[amid].min() > 0.9
    assert (lost.kind[amid] == SurfaceKind.WATER).all()


def test_a_shape_told_before_with_more_of_the_surroundings_counts() -> None:
    cells = made(lambda x, _: 0 * x, 30)
    assert classify(cells).water.max() <= SUSPICION
    known = np.full(cells.shape, 5.0, np.float32)
    assert classify(cells, None, known).water[cells.seen].min() > SUSPICION


@pytest.mark.parametrize(
    ("dark", "lost", "refused"), [(20, 40, True), (20, 0, False), (-20, 40, False), (-20, 0, False)]
)
def test_darkness_and_lost_rays_together_outweigh_the_bank_beside_a_shore(
    dark: float, lost: float, refused: bool
) -> None:
    slope = made(lambda x, y: 0.05 * x + 0 * y, 40, per_m2=12)
    evidence = {DARK: dark, LOST_OBLIQUE: lost, REPORTED: lost, OBLIQUE: 0 if lost else 40}
    water = classify(with_fields(slope, evidence)).water[8:-8, 8:-8]
    assert (water > SUSPICION).all() if refused else (water <= SUSPICION).all()


@pytest.mark.parametrize(
    ("near", "slope", "refused"), [(30, 0.023, True), (30, 0.08, False), (0, 0.023, False)]
)
def test_an_attitude_that_errs_tilts_water_but_no_near_ray_returns_from_it(
    near: float, slope: float, refused: bool
) -> None:
    """By 1.3 degrees; ground beyond the reach of dark tarmac is told by its slope."""
    tilted = made(lambda x, y: slope * x + 0 * y, 40, per_m2=12)
    lost = {LOST_OBLIQUE: 30, LOST_NEAR: near, REPORTED: 30, OBLIQUE: 0}
    water = classify(with_fields(tilted, lost)).water[8:-8, 8:-8]
    assert (water > SUSPICION).all() if refused else (water <= SUSPICION).all()


def test_bright_oblique_returns_outweigh_lost_rays() -> None:
    """Of tarmac around cars, which hide it: a flat roof, a wet car park."""
    level = made(lambda x, y: 0.012 * x + 0 * y, 40, per_m2=12)
    lost = {LOST_OBLIQUE: 40, LOST_NEAR: 40, REPORTED: 10, OBLIQUE: 1}
    dim, bright = (classify(with_fields(level, lost | {DARK: n})).water[8:-8, 8:-8] for n in (0, -10))
    assert (dim > SUSPICION).all()
    assert (bright <= SUSPICION).all()


def test_the_cells_through_which_a_shore_passes_are_refused_with_the_water() -> None:
    meadow = made(lambda x, y: 0.03 * y + 0 * x, 40, per_m2=12)
    wet = np.arange(40)[:, np.newaxis] + np.zeros(40) < 20
    rays = {OBLIQUE: 30 * ~wet, LOST_OBLIQUE: 30 * wet, LOST_NEAR: 30 * wet, REPORTED: 30 * wet}
    refused = classify(with_fields(meadow, rays)).water > SUSPICION
    assert refused[:21, 5:-5].all()
    assert not refused[21:].any()
