"""Directions of lost rays batch by batch, against the same in NumPy's plain calls."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from companion.flight.sensors.decoders.livox_scan_pattern import (
    TAIL_NS,
    WAIT_NS,
    ScanPattern,
    reconstruct_directions,
)

TURN_NS, STEP_NS = 10_000_000, 5_000
BATCH = 2000  # pulses, 10 ms


def pulses(rng: np.random.Generator) -> tuple[Any, ...]:
    """Return places, stamps, lines of returns, and whether each is lost, of half a second."""
    stamps = np.arange(100_000, dtype=np.int64) * STEP_NS + 7_000_000_000
    lines = (np.arange(100_000) % 4).astype(np.uint8)
    azimuth = 2 * math.pi * (stamps - stamps[0]) / TURN_NS
    elevation = 0.3 + 0.1 * lines + 0.2 * np.sin(azimuth)
    flat = np.cos(elevation)
    unit = np.column_stack([flat * np.cos(azimuth), flat * np.sin(azimuth), np.sin(elevation)])
    lost = rng.random(100_000) < 0.1
    lost[30_000:31_500] = True  # no return in three quarters of a turn
    return (unit * rng.uniform(5, 30, (100_000, 1))).astype(np.float32), stamps, lines, lost


class PlainPattern:
    """What `ScanPattern` keeps and does, joined, ordered and masked anew in each batch."""

    def __init__(self) -> None:
        self.tail: Any = np.empty((0, 3), np.float32), np.empty(0, np.int64), np.empty(0, np.uint8)
        self.waiting: Any = np.empty(0, np.int64), np.empty(0, np.uint8)

    def direct(self, batch: Any, lost: Any, lost_ns: Any, lost_ring: Any) -> tuple[Any, Any, int]:
        unknown = np.isnan(lost[:, 0])
        newest_ns = max(int(batch[1].max(initial=0)), int(lost_ns.max(initial=0)))
        rays_ns = np.concatenate([self.waiting[0], lost_ns[unknown]])
        rays_ring = np.concatenate([self.waiting[1], lost_ring[unknown]])
        joined = [np.concatenate(pair) for pair in zip(self.tail, batch, strict=True)]
        order = np.argsort(joined[1], kind="stable")
        joined = [column[order] for column in joined]
        found = reconstruct_directions(joined[0], joined[1], joined[2], rays_ns, rays_ring)
        first, stop = np.searchsorted(joined[1], [newest_ns - TAIL_NS, newest_ns + 1])
        self.tail = tuple(column[first:stop] for column in joined)
        known = np.isfinite(found[:, 0])
        waits = ~known & (np.abs(newest_ns - rays_ns) <= WAIT_NS)
        self.waiting = rays_ns[waits], rays_ring[waits]
        return (
            np.concatenate([lost[~unknown], found[known]]),
            np.concatenate([lost_ns[~unknown], rays_ns[known]]),
            int(len(rays_ns) - known.sum() - waits.sum()),
        )


@pytest.mark.parametrize("shuffled", [False, True])
@pytest.mark.parametrize("told", [0.0, 0.3])
def test_lost_rays_of_batches(shuffled: bool, told: float) -> None:
    rng = np.random.default_rng(3)
    xyz, stamps, lines, lost = pulses(rng)
    pattern, plain = ScanPattern(), PlainPattern()
    found = 0
    for first in range(0, len(stamps), BATCH):
        own = np.arange(first, first + BATCH)
        if shuffled:
            own = rng.permutation(own.reshape(-1, 100)).ravel()  # packets in another order
        returns, rays = own[~lost[own]], own[lost[own]]
        directions = np.full((len(rays), 3), np.nan, np.float32)
        given = rng.random(len(rays)) < told
        directions[given] = xyz[rays[given]]
        batch = xyz[returns], stamps[returns], lines[returns]
        expected = plain.direct(batch, directions, stamps[rays], lines[rays])
        got = pattern.direct(*batch, directions, stamps[rays], lines[rays])
        assert np.array_equal(got[0], expected[0])
        assert np.array_equal(got[1], expected[1])
        assert (got[2], pattern.waiting) == (expected[2], len(plain.waiting[0]))
        found += len(got[1])
    assert 0.5 * lost.sum() < found < lost.sum()
