"""Returns as an image: a row for each laser, a column for each firing of all of them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from companion.flight.sensors.returns import RawReturns

F64 = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class RangeImage:
    """Ranges (m), intensities and points of pulses, (rows, columns), NaN without a return.

    Of two returns of a pulse the brighter is taken. unit_m: step of the ranges.
    """

    range_m: F64
    intensity: F64
    points_m: F64
    two_echoes: int

    @classmethod
    def of(cls, raw: RawReturns, firing_ns: int) -> RangeImage:
        """Return the image of a stream whose lasers fire together, or in turn, every `firing_ns`."""
        rows = int(raw.ring.max()) + 1
        column = (raw.stamp_ns - raw.stamp_ns.min()) // firing_ns
        columns = int(column.max()) + 1
        order = np.argsort(raw.intensity, kind="stable")  # the brighter is written last
        row, column = raw.ring[order].astype(int), column[order]
        points = raw.xyz_m[order].astype(np.float64)
        range_m, intensity = np.full((2, rows, columns), np.nan)
        xyz = np.full((rows, columns, 3), np.nan)
        xyz[row, column] = points
        range_m[row, column] = np.linalg.norm(points, axis=1)
        intensity[row, column] = raw.intensity[order]
        return cls(range_m, intensity, xyz, int(np.count_nonzero(raw.echoes == 2)) // 2)
