"""Outages of GPS, scans and position, with the delays after which they count and are over."""

from __future__ import annotations

from companion.flight.landing.situation import MissingInput, Situation
from params import Parameters

SECOND = 1_000_000_000
CALL_NS = 10 * SECOND  # outage before the pilot is called
BACK_NS = SECOND  # time without a gap that ends an outage
GPS_PATIENCE_NS = SECOND // 2  # a shorter loss of GPS is over at once
GUIDES_NS = 5 * SECOND  # in which dead reckoning certainly guides: ArduPilot 7.3 s, PX4 sinks by itself then
GPS_BACK_NS = (
    5 * SECOND
)  # a receiver that has just found its satellites may lose them again, or err by metres


class Outage:
    """An outage, from the first missing input until all inputs have been present for a second.

    The missing input may change or return for an instant: to the pilot this is one outage. The time until the
    call restarts when an input is missing that was not missing before, such as late maps after a lost link,
    but not when the same inputs are missing in turn.
    """

    def __init__(self) -> None:
        self._since_ns: int | None = None
        self._present_ns: int | None = None
        self._reported: set[MissingInput] = set()
        self._called_for: MissingInput | None = None

    def on_missing(self, missing: MissingInput, now_ns: int) -> bool:
        """Record a missing input; return whether the pilot has not been warned of it yet."""
        self._present_ns = None
        if missing in self._reported or self._called_for:
            return False
        self._reported.add(missing)
        self._since_ns = now_ns
        return True

    def calls_for(self, missing: MissingInput, now_ns: int) -> bool:
        """Return whether to call the pilot now: once in a long outage."""
        if self._called_for or self._since_ns is None or now_ns - self._since_ns <= CALL_NS:
            return False
        self._called_for = missing
        return True

    def on_present(self, now_ns: int) -> MissingInput | None:
        """Record that nothing is missing; return the input of a call that is back now, else None."""
        if self._since_ns is None:
            return None
        if self._present_ns is None:
            self._present_ns = now_ns
        if now_ns - self._present_ns < BACK_NS:
            return None
        called_for = self._called_for
        self.reset()
        return called_for

    def reset(self) -> None:
        """End the outage: a new order starts from zero."""
        self._since_ns = self._present_ns = None
        self._reported.clear()
        self._called_for = None


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
        return self._since_ns is not None and self._last_ns - self._since_ns >= GPS_PATIENCE_NS

    def still_guides(self, now_ns: int) -> bool:
        """Return whether the estimate will guide the vehicle for some seconds more."""
        return self._since_ns is None or now_ns - self._since_ns < GUIDES_NS

    def follow(self, s: Situation) -> None:
        """Update from the present situation."""
        if s.gps_lost and not (self._is_sent and s.tracked):
            self._since_ns = s.now_ns if self._since_ns is None else self._since_ns
            self._last_ns = s.now_ns
        elif not self.lasts or s.now_ns - self._last_ns >= GPS_BACK_NS:
            self._since_ns = None
