"""Mapping of an external odometry's stamps to the companion's clock."""

from __future__ import annotations

from collections.abc import Callable

# Stamps are those of measurements that a program has worked on since.
LATE_NS = 500_000_000
EARLY_NS = 20_000_000  # clocks of two computers that are synchronised over a network
Offset = Callable[[int], int | None]


class OdometryClock:
    """Offset of the stamps: that of the LiDAR's clouds, or that of the time of day.

    Programs copy the stamps of the clouds that they register, so that clouds and poses are of one clock,
    whatever it is. Other stamps are the time of day of this computer, or of one that is synchronised.
    Arrivals do not give the offset, as they do for packets of a sensor: a pose comes after an unknown time of
    work, and at 5 m/s a tenth of a second is half a metre.

    Parameters
    ----------
    cloud_offset_ns
        Returns the offset of the clouds' stamps from the companion's clock near a stamp, None without one.
    wall_offset_ns
        Returns the offset of UTC from the companion's clock.
    """

    def __init__(self, cloud_offset_ns: Offset, wall_offset_ns: Callable[[], int]) -> None:
        self._offsets: list[Offset] = [cloud_offset_ns, lambda _stamp_ns: -wall_offset_ns()]

    def map(self, stamp_ns: int, arrival_ns: int) -> int | None:
        """Return the time of a stamp on the companion's clock; None if it is of neither clock."""
        for offset_of in self._offsets:
            offset_ns = offset_of(stamp_ns)
            if offset_ns is None or not -EARLY_NS <= arrival_ns - stamp_ns - offset_ns <= LATE_NS:
                continue
            if offset_of is not self._offsets[0]:  # it stays that of this odometry as long as it fits
                self._offsets.reverse()
            return stamp_ns + offset_ns
        return None
