"""Recognition of a LiDAR that repeats one picture, with stamps and counters that go on.

From another height or at another tilt the ground is at another distance, and no sensor measures the same
distances twice: a scan whose returns are, bit by bit, those that came from there, shows nothing of now. At
one height and tilt they may be true: over level ground, in a simulator without noise. A sensor of a few
thousand returns a second is not judged: its coarse steps show a wall at the same distances from any height.
"""

from __future__ import annotations

import math
from collections import OrderedDict
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

# Differences in height and tilt beyond those of any estimate's noise within the memory.
CLIMBED_M, TILTED_DEG = 0.15, 1.5
REMEMBERED_NS = 1_500_000_000  # since a return was last seen
ONE_OF = 32  # returns that are remembered, chosen by their own bits
LEAST = 12  # different ones of them in a scan, to judge it
SHARE = 0.8
MOST = 100_000  # returns remembered, whatever the stamps say
ROW_BYTES = 12  # of a return
MIXED = np.uint32(0x9E3779B1)  # spreads the bits of a number over its highest ones (Knuth)


@dataclass(frozen=True, slots=True)
class View:
    """From where a scan was measured.

    Attributes
    ----------
    up_m
        Height of the vehicle in the map frame.
    up_frd
        Unit vector (3,) upwards, in the axes of the body.
    """

    up_m: float
    up_frd: NDArray[np.float64]

    def is_other(self, view: View) -> bool:
        """Return whether the ground shows other distances from there."""
        if abs(self.up_m - view.up_m) > CLIMBED_M:
            return True
        return float(self.up_frd @ view.up_frd) < math.cos(math.radians(TILTED_DEG))


class RepeatedPicture:
    """Memory of returns and of the views in which they came first.

    Attributes
    ----------
    returns
        Returns of scans that repeated others.
    """

    def __init__(self) -> None:
        self._first: OrderedDict[bytes, tuple[View, int]] = OrderedDict()  # with the time of the last one
        self.returns = 0

    def __len__(self) -> int:
        """Return the number of remembered returns."""
        return len(self._first)

    def is_repeated(self, xyz_sensor_m: NDArray[np.float32], view: View, stamp_ns: int) -> bool:
        """Return whether a scan repeats one of another view, and remember it.

        Parameters
        ----------
        xyz_sensor_m
            (n, 3) returns in the sensor's frame.
        view
            That of the scan.
        stamp_ns
            Time of the scan; one before that of the scan before begins anew.
        """
        forward = xyz_sensor_m[:, 0].view(np.uint32) * MIXED
        rows = xyz_sensor_m[forward < 2**32 // ONE_OF].tobytes()
        chosen = {rows[at : at + ROW_BYTES] for at in range(0, len(rows), ROW_BYTES)}
        self._forget(stamp_ns)
        again = 0
        for row in chosen:
            first, _ = self._first.pop(row, (view, 0))
            again += first is not view and view.is_other(first)
            self._first[row] = first, stamp_ns
        repeated = len(chosen) >= LEAST and again >= SHARE * len(chosen)
        self.returns += len(xyz_sensor_m) if repeated else 0
        return repeated

    def _forget(self, stamp_ns: int) -> None:
        if self._first and stamp_ns < next(reversed(self._first.values()))[1]:
            self._first.clear()
        while self._first and (
            len(self._first) > MOST or stamp_ns - next(iter(self._first.values()))[1] > REMEMBERED_NS
        ):
            self._first.popitem(last=False)
