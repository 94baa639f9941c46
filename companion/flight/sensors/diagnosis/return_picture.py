"""Running picture of a stream's returns: counts by azimuth sector and laser line, of a sample of them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from companion.flight.sensors.returns import RawReturns

SECTORS = 36
SECTOR_DEG = 360 / SECTORS
LINES = 256
STRIDE = 7  # odd, so that all lines are sampled
BAND = 3.0  # times the reach of the window's returns: nearer than that, but beyond, is the vehicle or ground
MOST = 16_384  # sampled returns between two looks; more are not counted

Counts = NDArray[np.int64]


class Picture:
    """Counts since the beginning, in constant memory.

    Parameters
    ----------
    near_m
        Returns nearer than that are counted apart.

    Attributes
    ----------
    seen, near, close
        (36,) sampled returns by azimuth of 10 degrees, counter-clockwise from the sensor's x axis: all,
        those nearer than `near_m`, and those beyond it but nearer than three times as far.
    lines
        (256,) sampled returns by laser line.
    """

    def __init__(self, near_m: float) -> None:
        self._near_m2 = near_m * near_m
        self._xyz = np.empty((MOST, 3), np.float32)
        self._ring = np.empty(MOST, np.uint8)
        self._count = self._phase = 0
        self.seen: Counts = np.zeros(SECTORS, np.int64)
        self.near: Counts = np.zeros(SECTORS, np.int64)
        self.close: Counts = np.zeros(SECTORS, np.int64)
        self.lines: Counts = np.zeros(LINES, np.int64)

    def add(self, raw: RawReturns) -> None:
        """Store a sample of a batch."""
        xyz, ring = raw.xyz_m[self._phase :: STRIDE], raw.ring[self._phase :: STRIDE]
        self._phase = (self._phase - len(raw)) % STRIDE
        first = self._count
        last = min(MOST, first + len(ring))
        self._xyz[first:last], self._ring[first:last] = xyz[: last - first], ring[: last - first]
        self._count = last

    def look(self) -> None:
        """Count the stored sample."""
        n, self._count = self._count, 0
        if not n:
            return
        x, y, z = self._xyz[:n].T
        azimuth = np.arctan2(y, x)
        sector = (azimuth * np.float32(SECTORS / (2 * np.pi))).astype(np.float32)
        at = np.floor(sector).astype(np.int64) % SECTORS
        range_m2 = x * x + y * y + z * z
        near = range_m2 < self._near_m2
        close = ~near & (range_m2 < BAND * BAND * self._near_m2)
        self.seen += np.bincount(at, minlength=SECTORS)
        self.near += np.bincount(at[near], minlength=SECTORS)
        self.close += np.bincount(at[close], minlength=SECTORS)
        self.lines += np.bincount(self._ring[:n], minlength=LINES)
