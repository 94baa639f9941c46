"""Recognition of a LiDAR that repeats one picture, with stamps and counters that go on.

From another height the ground is at another distance, and no sensor measures the same distances twice: a scan
whose returns are, bit by bit, those that came from another height, shows nothing of now. At one height they
may be true: of a vehicle that stands, in a simulator without noise. A sensor of a few thousand returns a
second is not judged: its coarse steps show a wall at the same distances from any height.
"""

from __future__ import annotations

from collections import OrderedDict

import numpy as np
from numpy.typing import NDArray

CLIMBED_M = 0.15  # difference in height beyond that of any estimate's noise within the memory
REMEMBERED_NS = 1_500_000_000  # since a return was last seen
ONE_OF = 32  # returns that are remembered, chosen by their own bits
LEAST = 12  # different ones of them in a scan, to judge it
SHARE = 0.8
MOST = 100_000  # returns remembered, whatever the stamps say
MIXED = np.uint32(0x9E3779B1)  # spreads the bits of a number over its highest ones (Knuth)


class RepeatedPicture:
    """Memory of returns and of the heights from which they came first.

    Attributes
    ----------
    returns
        Returns of scans that repeated others.
    """

    def __init__(self) -> None:
        self._first_m: OrderedDict[bytes, tuple[float, int]] = OrderedDict()  # with the time of the last one
        self.returns = 0

    def __len__(self) -> int:
        """Return the number of remembered returns."""
        return len(self._first_m)

    def is_repeated(self, xyz_sensor_m: NDArray[np.float32], up_m: float, stamp_ns: int) -> bool:
        """Return whether a scan repeats one that came from another height, and remember it.

        Parameters
        ----------
        xyz_sensor_m
            (n, 3) returns in the sensor's frame.
        up_m
            Height of the vehicle in the map frame.
        stamp_ns
            Time of the scan; one before that of the scan before begins anew.
        """
        forward = xyz_sensor_m[:, 0].view(np.uint32) * MIXED
        chosen = {row.tobytes() for row in xyz_sensor_m[forward < 2**32 // ONE_OF]}
        self._forget(stamp_ns)
        again = 0
        for row in chosen:
            first_m, _ = self._first_m.pop(row, (up_m, 0))
            again += abs(up_m - first_m) > CLIMBED_M
            self._first_m[row] = first_m, stamp_ns
        repeated = len(chosen) >= LEAST and again >= SHARE * len(chosen)
        self.returns += len(xyz_sensor_m) if repeated else 0
        return repeated

    def _forget(self, stamp_ns: int) -> None:
        if self._first_m and stamp_ns < next(reversed(self._first_m.values()))[1]:
            self._first_m.clear()
        while self._first_m and (
            len(self._first_m) > MOST or stamp_ns - next(iter(self._first_m.values()))[1] > REMEMBERED_NS
        ):
            self._first_m.popitem(last=False)
