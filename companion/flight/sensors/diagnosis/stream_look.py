"""State of a stream at one moment, and what changed between two."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Counts = NDArray[np.int64]
COUNTED = ("packets", "lost_packets", "malformed", "bad_checksum", "failed", "foreign", "wrong_sensor", "imu")


@dataclass(frozen=True, slots=True)
class StreamLook:
    """Counts since the beginning; or, as the difference of two looks, of the time between them.

    Attributes
    ----------
    at_ns
        Companion clock.
    stamp_ns
        Newest stamp on the sensor's clock.
    unfit
        Packets of this maker that the decoder cannot use.
    dropped
        Packets that the kernel dropped.
    repeated
        Returns of pictures that the sensor had sent before.
    azimuth_packets, seen, near, close, lines
        See `PacketSigns` and `Picture`.
    """

    at_ns: int
    stamp_ns: int
    packets: int
    lost: int
    spoilt: int
    foreign: int
    wrong_sensor: int
    imu: int
    unfit: int
    dropped: int
    repeated: int
    covered_ns: int
    azimuth_packets: Counts
    seen: Counts
    near: Counts
    close: Counts
    lines: Counts

    def since(self, earlier: StreamLook) -> StreamLook:
        """Return what changed since an earlier look."""
        return StreamLook(*(getattr(self, name) - getattr(earlier, name) for name in self.__slots__))

    @property
    def lost_share(self) -> float:
        """Share of the packets that are missing."""
        return max(0, self.lost) / max(1, self.lost + self.packets)


def spoilt_of(statistics: Mapping[str, int | float | None]) -> int:
    """Return the number of damaged packets."""
    return sum(int(statistics.get(name) or 0) for name in ("malformed", "bad_checksum", "failed"))
