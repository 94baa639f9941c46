"""Loss of GPS: the autopilot's estimate lives on for some seconds, drifting, and then fails.

Each second of flight then is a second of blind sinking with the wind later. So nothing climbs or flies aside
any more: a descent goes on as low as it gets, everything else hovers where it is. A map placed by a drifting
estimate seems to change: the last verified state of the point holds.
"""

from __future__ import annotations

from companion.flight.landing.situation import Situation
from params import Parameters

SECOND = 1_000_000_000
PATIENCE_NS = SECOND // 2  # a shorter loss is over at once
GUIDES_NS = (
    5 * SECOND
)  # for which a dead reckoning certainly guides: ArduPilot 7.3 s, PX4 sinks by itself then
BACK_NS = 5 * SECOND  # a receiver that has just found its satellites may lose them again, or err by metres


class GpsLoss:
    """Tracks the loss of GPS while no odometry that the autopilot uses knows the place."""

    def __init__(self, parameters: Parameters) -> None:
        self._is_sent = parameters.odometry == "autopilot"
        self._since_ns: int | None = None
        self._last_ns = 0

    @property
    def is_on(self) -> bool:
        """True if GPS is lost, from the first report without a fix until it has been back for a while."""
        return self._since_ns is not None

    @property
    def lasts(self) -> bool:
        """True if it is more than a report or two without a fix."""
        return self._since_ns is not None and self._last_ns - self._since_ns >= PATIENCE_NS

    def still_guides(self, now_ns: int) -> bool:
        """Return whether the estimate will guide the vehicle for some seconds more."""
        return self._since_ns is None or now_ns - self._since_ns < GUIDES_NS

    def follow(self, s: Situation) -> None:
        """Update from the present situation."""
        if s.gps_lost and not (self._is_sent and s.tracked):
            self._since_ns = s.now_ns if self._since_ns is None else self._since_ns
            self._last_ns = s.now_ns
        elif not self.lasts or s.now_ns - self._last_ns >= BACK_NS:
            self._since_ns = None
