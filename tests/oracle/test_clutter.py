"""Ground and others near isolated returns, and their verdicts, against plain counting and Poisson's law."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.stats import poisson

from slz.kernels.cells.cell_record import COUNT, FIELDS, MEAN, TILE
from slz.kernels.cells.tile_directory import enter
from slz.kernels.points.clutter import by_chance, ground_and_rays
from slz.kernels.points.isolated_returns import (
    BIN_M,
    BINS,
    CONTRADICTING,
    DEEPEST_M,
    FALSE_ALARM,
    HAZARD_M2,
    LAYER_M,
    MOST,
    MOST_SHARE,
    OPAQUE,
    SMALL_M,
    SMALLEST_M2,
    SOLID,
    SURE,
    judge,
    outcome,
)
from slz.kernels.points.nearest_others import (
    BAND,
    DISTANT,
    FATE,
    FOUND,
    GONE,
    GROUND,
    HIGH,
    HIGH_M,
    ISOLATED_FIELDS,
    LEVEL,
    LEVEL_GROUND,
    LEVEL_M,
    LONELY,
    LONELY_LEVEL_M,
    LONELY_M,
    LOW,
    MOST_OTHERS,
    NEAREST_M,
    NO_BAND,
    NUMBER,
    OVER,
    RAYS,
    REACH_M,
    SENSOR_UP,
    SOLID_OBJECT,
    STAYS,
    UP,
    UPRIGHT,
    UPRIGHT_M,
    WAS_FOUND,
    add_others,
)
from slz.kernels.points.voxel_density_filter import is_supported

Floats = NDArray[np.float64]


def bands_of(over_m: Floats) -> Floats:
    return np.where(over_m < 0, 0.0, np.where(over_m > HIGH_M, 2.0, 1.0))


def bin_of(over_m: Floats) -> NDArray[np.int64]:
    return np.clip(np.floor((over_m - DEEPEST_M) / BIN_M), 0, BINS - 1).astype(np.int64)


@pytest.mark.parametrize("seed", range(6))
def test_the_nearest_others_are_those_that_counting_finds(seed: int) -> None:
    """The returns come in three windows."""
    rng = np.random.default_rng(seed)
    n = 300
    records = np.zeros((n, ISOLATED_FIELDS))
    points = np.column_stack([rng.uniform(-4, 4, (n, 2)), rng.uniform(-2, 6, n)])
    bands = bands_of(points[:, 2])
    bands[rng.random(n) < 0.1] = NO_BAND
    records[:, : UP + 1], records[:, BAND], records[:, LONELY] = points, bands, 1.0
    records[:, UPRIGHT:] = np.inf
    for k in range(3):
        new = np.arange(k * n // 3, (k + 1) * n // 3)
        new = new[bands[new] != NO_BAND]
        add_others(records[: (k + 1) * n // 3], new, np.full(len(new), REACH_M))
    for i in range(n):
        away = np.maximum(np.hypot(*(points[:, :2] - points[i, :2]).T), NEAREST_M)
        rise = np.abs(points[:, 2] - points[i, 2])
        other = (bands == bands[i]) & (bands[i] >= 0) & (np.arange(n) != i) & (away <= REACH_M)
        tall = other & ((bands != HIGH) | (rise <= UPRIGHT_M))
        for first, which in ((UPRIGHT, tall), (LEVEL, other & (rise <= LEVEL_M))):
            wanted = np.sort(away[which])[:MOST_OTHERS]
            found = records[i, first : first + MOST_OTHERS]
            np.testing.assert_allclose(found, [*wanted, *[np.inf] * (MOST_OTHERS - len(wanted))])
        near = np.where(rise <= LEVEL_M, LONELY_LEVEL_M, LONELY_M)
        assert records[i, LONELY] == (not (other & (rise <= UPRIGHT_M) & (away <= near)).any())


@pytest.mark.parametrize("expected", [1e-6, 0.01, 0.7, 5.0])
def test_the_chance_of_so_many_is_poisson_s(expected: float) -> None:
    told = [by_chance(k, expected) for k in range(1, 7)]
    np.testing.assert_allclose(told, poisson.sf(np.arange(6), expected), rtol=1e-6, atol=1e-12)


@pytest.mark.parametrize("seed", range(4))
def test_verdicts_are_those_of_poisson_s_law_and_of_the_shares_around(seed: int) -> None:
    rng, n, rays = np.random.default_rng(seed), 400, 60_000
    records = np.zeros((n, ISOLATED_FIELDS))
    over = np.where(rng.random(n) < 0.7, rng.uniform(-2, 6, n), rng.uniform(-60, 210, n))
    records[:, OVER], records[:, UP], records[:, BAND] = over, over, bands_of(over)
    records[:, RAYS], records[:, SENSOR_UP] = rng.uniform(1, 3000, n) ** rng.uniform(0, 1, n), 25.0
    records[:, NUMBER], records[:, LONELY] = np.arange(n), rng.random(n) < 0.3
    others = np.sort(NEAREST_M + rng.exponential(0.4, (2, n, MOST_OTHERS)), axis=2)
    others[rng.random(others.shape) < 0.3] = np.inf
    records[:, UPRIGHT:] = np.sort(others, axis=2).transpose(1, 0, 2).reshape(n, -1)
    records[rng.random(n) < 0.1, BAND] = NO_BAND
    records[:, DISTANT] = rng.random(n) < 0.2
    given_up = rng.poisson(0.2, (2, BINS))
    told, given = records.copy(), given_up.copy()
    high_shares = judge(told, given, rays)

    known, clutter = records[:, BAND] != NO_BAND, given_up.sum(axis=0)
    np.add.at(clutter, bin_of(over[known & (records[:, LONELY] > 0)]), 1)
    shares = []
    for i in np.flatnonzero(known):
        band = int(records[i, BAND])
        first, end = (0, *bin_of(np.array([0.0, HIGH_M])).tolist(), BINS)[band : band + 2]
        low, high = bin_of(over[i] + np.array([-LAYER_M, LAYER_M]))
        low, high = max(low, first), min(high + 1, end)
        around = min((clutter[low:high].sum() + 1) / rays, MOST_SHARE)
        upright = min((clutter[first:end].sum() + 1) / rays, MOST_SHARE)
        if band == HIGH:
            upright = around * UPRIGHT_M / LAYER_M
            shares.append(upright)
        down = max(25.0 - over[i], 1.0)
        passed = records[i, RAYS] * (((down + over[i]) / down) ** 2 if over[i] > 0 else 1.0)
        least = 1.0
        for start, share in ((UPRIGHT, upright), (LEVEL, min(around * LEVEL_M / LAYER_M, upright))):
            for k, away in enumerate(records[i, start : start + MOST_OTHERS].tolist(), 1):
                through = passed * np.pi * away**2
                if np.isfinite(away) and (band == HIGH or k + 1 >= OPAQUE * through):
                    least = min(least, float(poisson.sf(k - 1, through * share)))
        certain = least < FALSE_ALARM[band]
        small = (
            abs(over[i]) < SMALL_M
            and not records[i, DISTANT]
            and records[i, RAYS] * HAZARD_M2 < CONTRADICTING
        )
        solid = certain and max(records[i, UPRIGHT + SOLID - 2], records[i, LEVEL + SOLID - 2]) <= LONELY_M
        contradicted = not (certain or small) and passed * SMALLEST_M2 >= SURE
        fate = SOLID_OBJECT if solid else GONE if contradicted else STAYS
        assert (told[i, FATE], told[i, FOUND]) == (fate, (certain or small) and not solid)
    np.testing.assert_allclose(high_shares, shares, rtol=1e-12)
    lost = known & (told[:, FATE] == GONE) & (records[:, LONELY] > 0)
    np.testing.assert_array_equal(given[0], given_up[0] + np.bincount(bin_of(over[lost]), minlength=BINS))
    assert {STAYS, GONE} <= set(told[:, FATE].tolist())


@pytest.mark.parametrize(("found", "stay"), [(3, 3), (MOST + 5, MOST)])
def test_beyond_the_limit_clutter_goes_first_and_then_the_oldest_object(found: int, stay: int) -> None:
    """Objects are low, with few rays, and older than the clutter, which is high and lonely."""
    rng, n = np.random.default_rng(1), found + MOST
    records = np.zeros((n, ISOLATED_FIELDS))
    records[:, BAND], records[:, OVER], records[:, RAYS], records[:, LONELY] = LOW, 2.0, 10.0, 1.0
    records[:found, OVER] = 0.4
    records[:, NUMBER], records[:, UPRIGHT:] = np.arange(n), np.inf
    records = records[rng.permutation(n)]
    judge(records, np.zeros((2, BINS), np.int64), 100_000)
    kept = records[records[:, FATE] == STAYS]
    assert (len(kept), int(kept[:, FOUND].sum())) == (MOST, stay)
    assert kept[kept[:, FOUND] > 0, NUMBER].min() == found - stay
    clutter = kept[kept[:, FOUND] == 0, NUMBER]
    assert clutter.min(initial=n - len(clutter)) == n - len(clutter)


def test_what_leaves_for_the_surface_is_sorted_by_why_and_what_altered_is_what_was_found_or_is() -> None:
    records = np.random.default_rng(4).integers(0, 5, (300, ISOLATED_FIELDS)).astype(float)
    records[:, FOUND], records[:, WAS_FOUND] = records[:, [FOUND, WAS_FOUND]].T > 2
    found, altered, surface = outcome(records)
    places, fate = records[:, : UP + 1], records[:, FATE]
    np.testing.assert_array_equal(found, places[records[:, FOUND] == 1])
    np.testing.assert_array_equal(altered, places[records[:, FOUND] != records[:, WAS_FOUND]])
    fates = (GROUND, LEVEL_GROUND, SOLID_OBJECT)
    np.testing.assert_array_equal(surface, np.concatenate([places[fate == which] for which in fates]))


def test_ground_and_rays_are_those_of_the_cells_around() -> None:
    """Tiles lie at random slots, and some are missing."""
    rng, cell, tiles = np.random.default_rng(5), 0.25, (3, 4)
    pool = np.zeros((20, TILE, TILE, 2, FIELDS), np.float32)
    pool[..., COUNT] = (
        rng.integers(0, 4, pool.shape[:-1]) * (rng.random(pool.shape[:3]) < 0.2)[..., np.newaxis]
    )
    pool[..., 1, COUNT] *= pool[..., 0, COUNT] > 0
    pool[..., MEAN] = rng.normal(0, 2, pool.shape[:-1])
    table = rng.permutation(20)[:12].reshape(tiles).astype(np.int32)
    table[1, 2] = -1
    size = np.array(tiles[::-1]) * TILE * cell
    corner, west, south = np.array([-2, 5]), 7.0, -3.0  # first row and column of tiles; where they count from
    first = corner[::-1] * TILE * cell + np.array([west, south])
    points = np.column_stack([first + rng.uniform(-1, size + 1, (2000, 2)), rng.normal(0, 2, 2000)])
    directory = np.full((32, 3), -1, np.int32)
    for r, c in np.argwhere(table >= 0).tolist():
        enter(directory, int(corner[0]) + r, int(corner[1]) + c, int(table[r, c]))
    told = ground_and_rays(points, west, south, cell, pool, directory)
    edge = 10  # cells without evidence on all sides
    whole = np.zeros((tiles[0] * TILE + 2 * edge, tiles[1] * TILE + 2 * edge, 2, FIELDS), np.float32)
    for r, c in np.argwhere(table >= 0):
        whole[edge + r * TILE :, edge + c * TILE :][:TILE, :TILE] = pool[table[r, c]]
    for point, (over, rays_m2) in zip(points, told, strict=True):
        col, row = np.floor((point[:2] - first) / cell).astype(int) + edge
        held = whole[row - 2 : row + 3, col - 2 : col + 3]
        count = held[..., COUNT].sum(axis=-1)
        assert rays_m2 == pytest.approx(count.sum() / (5 * cell) ** 2)
        with np.errstate(invalid="ignore"):
            away = point[2] - (held[..., COUNT] * held[..., MEAN]).sum(axis=-1) / count
        near = away[1:4, 1:4] if (count[1:4, 1:4] > 0).any() else away
        nearest = np.nan if np.isnan(near).all() else near.ravel()[np.nanargmin(abs(near))]
        assert over == pytest.approx(nearest, abs=1e-5, nan_ok=True)


# Voxel density filter of returns: lists of columns, the hash table for wide clouds, and plain counting.


VOXEL_M, LEAST = 0.3, 2


def plainly(points: Floats, sensor: Floats, object_m2: float) -> list[bool]:
    """The rule of `slz.points.outliers.not_isolated`, counted point against point."""
    edge = np.array([VOXEL_M, VOXEL_M, VOXEL_M / 4])
    at = ((points - edge * np.floor(points.min(axis=0) / edge)) / edge).astype(np.int64)
    keep = []
    for point, here in zip(points, at, strict=True):
        away2 = float(((point - sensor) ** 2).sum())
        expected = object_m2 * len(points) / (4 * np.pi) / max(away2, 1e-2)
        near = expected > LEAST
        need = min(int(expected), 5 if away2 > 4.0 else 10_000) if near else LEAST
        beside = (np.abs(at[:, :2] - here[:2]) <= 1).all(axis=1)
        up = at[beside, 2] - here[2]
        own = int((at == here).all(axis=1).sum())
        if need < 5:
            need = max(need, min(5, int((np.abs(up) <= 20).sum()) // 10))
        keep.append(own >= max(need, 5) or int((np.abs(up) <= 1).sum()) >= need)
    return keep


@pytest.mark.parametrize("seed", range(12))
@pytest.mark.parametrize("far_m", [0.0, 3000.0])
@pytest.mark.parametrize("object_m2", [0.005, 0.4])
def test_company_is_what_counting_says(seed: int, far_m: float, object_m2: float) -> None:
    """A far return spreads the columns so wide that the hash table is used; large objects promise more."""
    rng = np.random.default_rng(seed)
    n = int(rng.integers(50, 900))
    ground = np.column_stack([rng.uniform(-6, 6, (n, 2)), rng.normal(0, 0.03, n)])
    wall = np.column_stack([np.full(200, 1.0), rng.uniform(0, 1, 200), rng.uniform(0, 3, 200)])
    dust = rng.uniform(-6, 6, (60, 3))
    echoes = np.column_stack([rng.uniform(-6, 6, (20, 2)), np.full(20, -0.3)])
    crowd = rng.normal(0, 0.1, (300, 3)) * [1, 1, 0.1] + [3, 3, 0]
    points = np.vstack([ground, wall, dust, echoes, crowd, [[far_m, far_m, 0.0]]])
    sensor = np.array([0.0, 0.0, float(rng.choice([0.5, 3.0, 20.0]))]) if seed % 4 else np.full(3, np.nan)
    told = is_supported(points, sensor, VOXEL_M, LEAST, object_m2).tolist()
    assert told == plainly(points, sensor, object_m2)
