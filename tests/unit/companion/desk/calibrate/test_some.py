"""Systematic sample of returns: bounded, and even over the flight."""

from __future__ import annotations

import numpy as np
import pytest

from companion.desk.calibrate.calibration import SystematicSample
from companion.flight.sensors.returns import Returns, join


def batch(first: int, count: int) -> Returns:
    stamps = np.arange(first, first + count)
    return Returns.plain(np.zeros((count, 3), np.float32), stamps)


@pytest.mark.parametrize("size", [1, 7, 100, 5000])
@pytest.mark.parametrize("total", [900, 1000, 1001, 5000])
def test_returns_are_thinned_evenly_and_never_more_than_so_many(size: int, total: int) -> None:
    sample = SystematicSample(1000)
    for first in range(0, total, size):
        sample.add_batch(batch(first, min(size, total - first)))
        assert sum(map(len, sample.parts)) <= 1000
    stamps = join(sample.parts).stamp_ns
    if total <= 1000:
        assert stamps.tolist() == list(range(total))
    else:
        assert len(stamps) >= 490
        steps = np.diff(stamps)
        assert steps.min() > 0
        assert steps.max() <= 2.1 * np.median(steps)
        assert stamps[-1] >= total - 2 * np.median(steps)
