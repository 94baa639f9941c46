"""Voxel density filter of returns: lists of columns, the hash table for wide clouds, and plain counting."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from slz.kernels.points.voxel_density_filter import is_supported

Floats = NDArray[np.float64]
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
