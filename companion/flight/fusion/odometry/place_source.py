"""Interface of an odometry: the source of the vehicle's place on the map."""

from __future__ import annotations

from typing import Protocol

from companion.flight.fusion.odometry.odometry_estimate import OdometryEstimate
from slz import Scan


class PlaceSource(Protocol):
    """Odometry that sets the history's correction.

    Attributes
    ----------
    name
        Name in texts to the pilot.
    estimate
        Newest pose on the map, None without one.
    """

    name: str
    estimate: OdometryEstimate | None

    def add(self, scan: Scan) -> None:
        """Take a scan as the autopilot's poses place it, and set the correction for it."""

    def tells_place(self, now_ns: int) -> bool:
        """Tell whether position and tilt are known now."""

    def is_tracking(self, now_ns: int) -> bool:
        """Tell whether the place is known now, or was within three seconds."""

    @property
    def gps_drift_m(self) -> float:
        """Distance by which the autopilot's position went off the map within the last ten seconds, m."""

    def statistics(self) -> dict[str, int]:
        """Return the counts."""
