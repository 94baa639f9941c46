"""Classification of surface cells by kernels, against the rules in plain NumPy."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import ndimage

from slz.kernels.surface.smooth_planes import smooth_planes
from slz.kernels.surface.surface_record import (
    ASIDE,
    ASIDE_LIGHT,
    ASIDE_M,
    COUNT,
    DARK,
    DEEP,
    HIGH,
    KIND,
    LOST_NEAR,
    LOST_OBLIQUE,
    LOST_SLANTED,
    LOW,
    MEAN,
    NADIR,
    NADIR_LIGHT,
    NADIR_M,
    NUMBERED,
    OBLIQUE,
    RAISED,
    REPORTED,
    SEVERAL,
    SLANTED,
    SQUARES,
    SURFACE_FIELDS,
    TALL,
)  # fmt: skip
from slz.surface.classification import SurveyClasses, classify
from tests.oracle.plain_surface import F32, Floats, classified, coarser

SEEDS = range(16)


def smooth(rng: np.random.Generator, shape: tuple[int, ...], cells: float) -> Floats:
    """Return smooth noise of unit deviation."""
    noise = ndimage.gaussian_filter(rng.normal(0, 1, shape), cells)
    return np.asarray(noise / noise.std())


def ground(rng: np.random.Generator, x: Floats, y: Floats) -> Floats:
    """Return land with lakes or rivers between banks, and houses, some with a court."""
    height = smooth(rng, x.shape, rng.uniform(3, 20)) * rng.uniform(0, 1) + rng.choice([0, 0.002, 0.02]) * x
    for _ in range(rng.integers(1, 4)):
        away = np.hypot(x - rng.uniform(0, x.max()), y - rng.uniform(0, y.max())) - rng.uniform(5, 30)
        level = height[np.unravel_index(away.argmin(), away.shape)] + rng.choice([0, 0.003]) * y
        bank = np.maximum(height, level + rng.choice([0.1, 0.3]) * away)
        height = np.where(away < 0, level, np.where(away < 6, bank, height))
    for _ in range(rng.integers(0, 5)):
        away = np.maximum(abs(x - rng.uniform(0, x.max())), abs(y - rng.uniform(0, y.max())))
        half, court = rng.uniform(3, 10), rng.choice([0, 2])
        height = np.where((away < half) & (away >= court), height.mean() + rng.uniform(1, 9), height)
    return height


def evidence(seed: int) -> F32:
    """Return cells of such ground with plants, gaps, and rays that water swallows, mirrors or darkens."""
    rng = np.random.default_rng(seed)
    rows, cols = rng.integers(30, 90, 2)
    y, x = np.indices((rows, cols)) + 0.5
    noise_m, f = rng.choice([0.005, 0.012, 0.03]), np.zeros((SURFACE_FIELDS, rows, cols), np.float32)
    count = rng.poisson(rng.choice([0.7, 2, 6, 20]), x.shape)
    hidden = smooth(rng, x.shape, 5)
    f[COUNT] = count = np.where(hidden > np.quantile(hidden, rng.uniform(0.6, 1)), 0, count)
    seen, plants = count > 0, smooth(rng, x.shape, 4) > rng.uniform(0.5, 3)
    f[MEAN] = seen * (ground(rng, x, y) + rng.normal(0, noise_m, x.shape) / np.sqrt(np.maximum(count, 1)))
    f[SQUARES] = count * (
        noise_m**2 * rng.gamma(3, 1 / 3, x.shape) + plants * rng.exponential(0.3, x.shape) ** 2
    )
    f[LOW] = seen * (f[MEAN] - 3 * noise_m - plants * rng.exponential(1, x.shape))
    f[HIGH] = seen * (f[MEAN] + 3 * noise_m + plants * rng.exponential(2, x.shape))
    f[DEEP], f[TALL] = plants * rng.poisson(0.2 * count), plants * rng.poisson(0.2 * count)
    wet = smooth(rng, x.shape, 6) > rng.uniform(0, 2)
    if seed % 2:
        f[NUMBERED], f[SEVERAL] = count, plants * rng.binomial(count, 0.2)
    if seed % 3:
        f[OBLIQUE] = rng.poisson(np.where(wet, 0.3, 3) * rng.choice([0.3, 1.0]), x.shape)
        f[SLANTED] = rng.poisson(np.where(wet, 1, 4))
    if seed % 3 == 1:
        f[REPORTED] = rng.integers(0, 9, x.shape) * (wet | (rng.random(x.shape) < 0.05))
        f[LOST_OBLIQUE] = f[LOST_NEAR] = f[REPORTED] * rng.integers(0, 3, x.shape)
        f[LOST_SLANTED] = f[REPORTED] * rng.integers(0, 3, x.shape)
    if seed % 4 > 1:
        f[DARK] = np.where(wet, rng.integers(-2, 9, x.shape), -rng.integers(0, 9, x.shape))
    if seed % 5 > 1:
        f[NADIR], f[ASIDE] = seen * rng.integers(0, 9, (2, *x.shape))
        drop = np.where(wet, rng.uniform(0, 0.2, x.shape), 0)
        f[NADIR_M], f[ASIDE_M] = f[MEAN] + drop / 2, f[MEAN] - drop / 2
        f[ASIDE_LIGHT] = rng.uniform(0.02, 0.35, x.shape)
        f[NADIR_LIGHT] = f[ASIDE_LIGHT] * np.where(wet, rng.uniform(1, 9, x.shape), 1.1)
    return f


def prior(seed: int, shape: tuple[int, ...]) -> tuple[SurveyClasses | None, F32 | None]:
    """Return classes of a survey for some, and what they say: log odds of roofs and plants, share of tall."""
    if seed % 4:
        return None, None
    building, low, tall = np.random.default_rng(seed).integers(0, 5, (3, *shape)).astype(np.float32)
    total, plants = np.full(shape, 12, np.float32), low + tall
    share = np.where(plants > 0, tall / np.maximum(plants, 1), np.nan)
    said = [6 * np.clip(building / total / 0.5, 0, 1), 6 * np.clip(plants / total / 0.5, 0, 1), share]
    return SurveyClasses(building, low, tall, total), np.stack(said).astype(np.float32)


def planes(count: F32, mean: F32, squares: F32, cell_m: float) -> F32:
    out: F32 = smooth_planes(*(np.ascontiguousarray(a) for a in (count, mean, squares)), cell_m)
    return out


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("is_far", [True, False])
def test_layers_are_those_of_the_plain_rules(seed: int, is_far: bool) -> None:
    f, cell_m = evidence(seed), (1.0, 0.9, 1.2)[seed % 3]
    classes, said = prior(seed, f.shape[1:])
    rng = np.random.default_rng(seed + 1000)
    shape = (rng.uniform(-4, 5, f.shape[1:]) * (smooth(rng, f.shape[1:], 8) > 0)).astype(np.float32)
    before, obliquely = None if is_far else shape, seed % 2 == 0
    own, wide = planes(f[COUNT], f[MEAN], f[SQUARES], cell_m), planes(*coarser(f), 2 * cell_m)
    expected = classified(f, own, wide, cell_m, before, said, obliquely)
    bare = 1 - expected[:4].sum(axis=0)
    decided = np.abs(np.concatenate([expected[:4], bare[np.newaxis]]).max(axis=0) - 0.5) > 1e-4
    found = classify(f, cell_m, classes, before, obliquely).values
    np.testing.assert_allclose(np.delete(found, KIND, 0), np.delete(expected, KIND, 0), rtol=1e-4, atol=1e-5)
    np.testing.assert_array_equal(found[KIND][decided], expected[KIND][decided])


def test_the_scenes_hold_every_kind_roofs_and_water_of_all_probabilities() -> None:
    layers = np.concatenate([classify(evidence(seed), 1.0).values.reshape(7, -1) for seed in SEEDS], axis=1)
    assert (np.bincount(layers[KIND].astype(int), minlength=6) > 200).all()
    assert np.count_nonzero(layers[RAISED]) > 1000
    water, _ = np.histogram(layers[0], np.linspace(0, 1, 11))
    assert (water > 20).all()
