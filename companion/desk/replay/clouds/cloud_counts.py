"""Counts of a recording's clouds, and of the points that were left out."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any

from companion.flight.sensors.decoders.point_clock import PointClock
from companion.flight.sensors.decoders.point_cloud import Decoded


@dataclass(slots=True)
class CloudCounts:
    """Counts of clouds, clouds without point times, and omitted points; see `Decoded`, `StampedCloud`."""

    clouds: int = 0
    clouds_without_point_times: int = 0
    points_without_return: int = 0
    points_with_false_times: int = 0
    points_of_low_confidence: int = 0

    def add(self, decoded: Decoded, clock: PointClock | None, doubtful: int = 0) -> bool:
        """Count a cloud; return whether it is used: one whose times are unlike those of the others is not."""
        self.clouds += 1
        self.clouds_without_point_times += not decoded.timed
        self.points_without_return += decoded.no_return
        self.points_with_false_times += decoded.false_times
        self.points_of_low_confidence += doubtful
        return decoded.timed or clock is None

    def summary(self, clock: PointClock | str) -> dict[str, Any]:
        """Return the counts and the meaning of point times, or the reason they are unused, for JSON."""
        known = isinstance(clock, PointClock)
        times = {"point_times": str(clock) if known else None, "why_no_point_times": "" if known else clock}
        return asdict(self) | times
