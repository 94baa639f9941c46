"""Columns in which something stands, against plain counting column by column."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from slz.kernels.air.passing_rays import (
    BASE,
    BASE_EAST,
    CAME,
    COL,
    COLUMN_FIELDS,
    EAST,
    FARTHER,
    GONE,
    OWN,
    RANGE,
    RETURNED,
    ROW,
    SAME_SIDE,
    SCANS_SINCE,
    SINCE,
    TOP,
    TOP_EAST,
    UP,
    index_of,
    passed,
)
from slz.kernels.air.standing_columns import join, stand_around

Floats = NDArray[np.float64]
WEST, SOUTH, CELL, AROUND, SAME_M, REACH, NOW_S = -3.1, 2.3, 0.25, 2, 0.7, 20, 9.0
HERE = np.array([-4.0, 6.0])  # row and column of the sensor
HIGHEST, LOWEST, WAY, COUNTS = (
    slice(TOP_EAST, TOP + 1),
    slice(BASE_EAST, BASE + 1),
    slice(EAST, UP + 1),
    slice(RETURNED, SCANS_SINCE + 1),
)


def some_columns(rng: np.random.Generator, n: int) -> Floats:
    records = np.zeros((n, COLUMN_FIELDS))
    places = rng.permutation(21 * 21)[:n]
    records[:, ROW], records[:, COL] = places // 21 - 14, places % 21 - 4
    records[:, CAME], records[:, GONE] = 1.0, rng.random(n) < 0.3
    records[:, COUNTS] = rng.integers(1, 9, (n, 6))
    records[:, TOP], records[:, BASE] = rng.uniform(1, 2, n), rng.uniform(0, 1, n)
    way = rng.normal(size=(n, 3)) * 0.1 - (0.0, 0.0, 1.0)
    records[:, WAY] = way / np.linalg.norm(way, axis=1, keepdims=True)
    records[:, RANGE] = rng.uniform(7, 12, n)
    return records


def some_returns(rng: np.random.Generator, n: int) -> Floats:
    """Return places half of which share columns with several others, some at the same height."""
    middle = np.array([WEST, SOUTH]) + HERE[::-1] * CELL
    away = rng.uniform(-6, 6, (n, 2)) * rng.choice([0.1, 1.0], (n, 1))
    return np.column_stack([middle + away, rng.uniform(-0.5, 3, n).round(1)])


def cell_of(point: Floats) -> tuple[int, int]:
    row, col = np.floor((point[1::-1] - (SOUTH, WEST)) / CELL)
    return int(row), int(col)


def added(held: dict[tuple[int, int], Floats], points: Floats, sensors: Floats) -> None:
    """Add returns to the columns, by their cells."""
    cells = [cell_of(point) for point in points]
    for cell in set(cells):
        here = [i for i, other in enumerate(cells) if other == cell]
        ways = points[here] - sensors[here]
        away = np.linalg.norm(ways, axis=1)
        mean = (ways / away[:, np.newaxis]).sum(axis=0)
        mean /= np.linalg.norm(mean)
        old = held.get(cell)
        if old is None or old[GONE]:
            old = np.zeros(COLUMN_FIELDS)
            old[[ROW, COL, CAME]], old[TOP], old[BASE] = (*cell, NOW_S), -np.inf, np.inf
        new = old.copy()
        nearest, farthest = sorted((away.mean(), old[RANGE]))
        if mean @ old[WAY] < SAME_SIDE or farthest > FARTHER * nearest:
            new[COUNTS] = 0.0
        new[WAY], new[RANGE] = mean, away.mean()
        for end, at in ((LOWEST, min(here, key=lambda i: points[i, 2])), (HIGHEST, -1)):
            if at < 0:
                at = max(reversed(here), key=lambda i: points[i, 2])
                beyond = points[at, 2] > old[TOP]
            else:
                beyond = points[at, 2] < old[BASE]
            if beyond:
                new[end] = points[at]
        held[cell] = new


def top_near(held: dict[tuple[int, int], Floats], point: Floats, around: int) -> float:
    row, col = cell_of(point)
    near = [(row + r, col + c) for r in range(-around, around + 1) for c in range(-around, around + 1)]
    return max((held[k][TOP] for k in near if k in held and not held[k][GONE]), default=-np.inf)


@pytest.mark.parametrize(("n", "share"), [(0, 0.05), (60, 0.0), (60, 0.05), (200, 0.3)])
@pytest.mark.parametrize("seed", range(3))
def test_returns_join_the_columns_that_they_are_in_or_beside(seed: int, n: int, share: float) -> None:
    rng = np.random.default_rng(seed)
    records, points = some_columns(rng, n), some_returns(rng, 600)
    raised, isolated = rng.random(600) < share, rng.random(600) < 0.3
    origin = np.sort(rng.integers(0, 4, 600)).astype(np.uint16)
    origins = np.append(points[:4, :2], np.full((4, 1), 12.0), axis=1)
    rows = rng.permutation(600)[:500]
    told = raised.copy()
    given = records.copy(), points, rows, told, isolated, origin, origins, HERE, REACH, AROUND
    joined, own, beside = join(*given, SAME_M, WEST, SOUTH, CELL, NOW_S)

    held = {(int(record[ROW]), int(record[COL])): record for record in records}
    within = np.array([max(np.abs(cell_of(point) - HERE)) <= REACH for point in points])
    taken = np.zeros(600, bool)
    for alone in (False, True):
        some = [i for i in rows if raised[i] and within[i] and isolated[i] == alone]
        if alone:
            some = [i for i in some if points[i, 2] <= top_near(held, points[i], AROUND) + SAME_M]
        added(held, points[some], origins[origin[some]])
        taken[some] = True
    assert np.array_equal(told[rows], taken[rows])
    wanted = np.array(list(held.values())).reshape(-1, COLUMN_FIELDS)
    if taken.any():
        wanted = wanted[np.lexsort((wanted[:, COL], wanted[:, ROW]))]
    np.testing.assert_allclose(joined, wanted, rtol=1e-12)
    ours = {i for i in rows if taken[i] or (top_near(held, points[i], 1) > -np.inf and not isolated[i])}
    near = {i for i in rows if points[i, 2] <= top_near(held, points[i], AROUND) + SAME_M}
    assert set(own.tolist()) == ours
    assert set(beside.tolist()) == near - ours


@pytest.mark.parametrize("seed", range(3))
def test_a_column_is_judged_by_the_rays_around_it_and_stays_while_one_around_it_stands(seed: int) -> None:
    rng = np.random.default_rng(seed)
    records = some_columns(rng, 120)
    row, col, index, blocks = index_of(records, AROUND)
    for k, record in enumerate(records):
        assert index[int(record[ROW]) - row, int(record[COL]) - col] == k
    full = {(r // 16, c // 16) for r, c in np.argwhere(index >= 0).tolist()}
    assert {(r, c) for r, c in np.argwhere(blocks).tolist()} == full
    assert int((index >= 0).sum()) == len(records)
    which, counts = passed(index, AROUND, 5.7, records)
    away = np.abs(records[:, np.newaxis, [ROW, COL]] - records[:, [ROW, COL]]).max(axis=2)
    judged = (records[:, SINCE] >= OWN) & (records[:, GONE] == 0) & (records[:, SCANS_SINCE] > 5)
    assert sorted(which.tolist()) == np.flatnonzero(judged).tolist()
    around = (away <= AROUND) @ records[:, RETURNED : SINCE + 1]
    np.testing.assert_array_equal(counts, np.hstack([around, records[:, SINCE + 1 : SCANS_SINCE + 1]])[which])
    stand = ((away <= AROUND) & (records[:, GONE] == 0)).any(axis=1)
    assert np.array_equal(stand_around(records, AROUND), stand)
