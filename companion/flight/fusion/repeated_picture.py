"""Recognition of a LiDAR that repeats one picture, with stamps and counters that go on.

From another height the ground is at another distance, and no sensor measures the same distances twice: a scan
whose returns are, bit by bit, those that came from another height, shows nothing of now. At one height they
may be true: of a vehicle that stands, in a simulator without noise. Sensors of few thousand returns a second
are not judged: their coarse steps show a wall at the same distances from any height.
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
FACTORS = np.array([0x9E3779B1, 0x85EBCA77, 0xC2B2AE3D], np.uint64)


class RepeatedPicture:
    """Memory of returns and of the heights from which they came first.

    Attributes
    ----------
    returns
        Returns of scans that repeated others.
    """

    def __init__(self) -> None:
        self._first_m: OrderedDict[int, tuple[float, int]] = OrderedDict()  # with the time of the last one
        self.returns = 0

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
        bits = xyz_sensor_m.view(np.uint32).astype(np.uint64) * FACTORS
        digests = np.bitwise_xor.reduce(bits, axis=1) >> np.uint64(7)
        chosen = set(digests[digests % np.uint64(ONE_OF) == 0].tolist())
        self._forget(stamp_ns)
        again = 0
        for digest in chosen:
            first_m, _ = self._first_m.pop(digest, (up_m, 0))
            again += abs(up_m - first_m) > CLIMBED_M
            self._first_m[digest] = first_m, stamp_ns
        repeated = len(chosen) >= LEAST and again >= SHARE * len(chosen)
        self.returns += len(xyz_sensor_m) if repeated else 0
        return repeated

    def _forget(self, stamp_ns: int) -> None:
        if self._first_m and stamp_ns < next(reversed(self._first_m.values()))[1]:
            self._first_m.clear()
        while self._first_m and stamp_ns - next(iter(self._first_m.values()))[1] > REMEMBERED_NS:
            self._first_m.popitem(last=False)
