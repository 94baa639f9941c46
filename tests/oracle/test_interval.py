"""Height gate of a window, sampled or not, against the written rule on the whole histogram."""

from __future__ import annotations

import math

import numpy as np
import pytest
from numpy.typing import NDArray

from slz.grid import Grid
from slz.kernels.paper.height_gate import CHUNK, SAMPLE_EVERY, SAMPLED_ABOVE
from slz.paper.window_cells import WindowCells

Heights = NDArray[np.float64]
BINS, THRESHOLD = 300, 0.9
GRID = Grid(-50.0, -50.0, 0.5, 200, 200)


def by_hand(height: Heights) -> tuple[float, float]:
    """Trim sparse end bins, the emptier first; nine tenths of the points stay (SLZ paper, section 3.2.1)."""
    low, high, n = height.min(), height.max(), len(height)
    scale = BINS / (high - low)
    count = np.bincount(np.minimum(((height - low) * scale).astype(int), BINS - 1), minlength=BINS).tolist()
    first, last, left = 0, BINS - 1, n
    while first < last:
        fewer = min(count[first], count[last])
        if fewer >= (1 - THRESHOLD) * n / BINS or left - fewer < THRESHOLD * n:
            break
        left -= fewer
        first, last = (first + 1, last) if count[first] <= count[last] else (first, last - 1)
    return low + first / scale, low + (last + 1) / scale


def accepted(height: Heights, seed: int) -> tuple[float, float]:
    """Return what is accepted of a window, among which some points are dropped and some lie outside."""
    rng = np.random.default_rng(seed)
    points = np.column_stack([rng.uniform(-49, 49, (len(height), 2)), height])
    points[: len(height) // 50, 0] = 60.0  # outside the grid, and yet a height
    dropped = np.full((40, 3), np.nan)
    points = np.insert(points, rng.integers(0, len(points), 40), dropped, axis=0)
    returns = WindowCells()
    returns.read(points, np.full(3, np.nan), math.inf, GRID)
    returns.keep_heights(BINS, THRESHOLD)
    return returns.low_m, returns.high_m


def ground(n: int, rng: np.random.Generator) -> Heights:
    """Flat ground at one height, roofs, birds and ghosts."""
    height = np.where(rng.random(n) < 0.7, rng.normal(0.0, 0.02, n), rng.uniform(0.0, 12.0, n))
    odd = rng.random(n) < 0.001
    return np.where(odd, rng.uniform(-48.0, 55.0, n), height)


def ramp(n: int, rng: np.random.Generator) -> Heights:
    """Fewer and fewer points upwards, so that no bin is far from sparse and none is surely not."""
    return 60.0 * rng.random(n) ** 6 - 3.0


def hidden(n: int, rng: np.random.Generator) -> Heights:
    """What is highest and lowest lies in the chunks that are not sampled, what is sampled is elsewhere."""
    chunk = np.arange(n) // CHUNK % SAMPLE_EVERY
    return np.where(chunk == 0, rng.normal(5.0, 0.1, n), rng.uniform(-20.0, 30.0, n))


def misleading(n: int, rng: np.random.Generator) -> Heights:
    """A few far below and above, all in chunks that are sampled: their bins are sparse all the same."""
    height = rng.normal(0.0, 1.0, n)
    sampled = np.flatnonzero(np.arange(n) // CHUNK % SAMPLE_EVERY == 0)
    height[sampled[3:8]], height[sampled[20:26]] = -20.0, 25.0
    return height


def level(n: int, rng: np.random.Generator) -> Heights:
    """Nearly all in one bin, which the others frame."""
    height = rng.uniform(2.0, 2.001, n)
    height[:2] = -10.0, 40.0
    return height


def bell(n: int, rng: np.random.Generator) -> Heights:
    """Bins that grow little by little from empty ends."""
    return rng.normal(0.0, 3.0, n)


def alike(n: int, rng: np.random.Generator) -> Heights:
    """As many in each bin: none is sparse."""
    return rng.permutation(np.linspace(-30.0, 70.0, n))


@pytest.mark.parametrize("n", [700, SAMPLED_ABOVE + 1, 2 * SAMPLED_ABOVE + 77])
@pytest.mark.parametrize("make", [ground, ramp, hidden, misleading, level, bell, alike])
def test_the_heights_accepted_are_those_of_the_whole_histogram(make: object, n: int) -> None:
    assert callable(make)
    for seed in range(3):
        height = make(n, np.random.default_rng(seed))
        assert accepted(height, seed) == pytest.approx(by_hand(height), abs=1e-9)
