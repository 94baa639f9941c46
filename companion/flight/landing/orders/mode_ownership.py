"""Flight mode: set by slz or by the pilot, and the pilot's hand-over to an automatic landing."""

from __future__ import annotations

from companion.flight.landing.situation import Situation

SETTLE_NS = 3_000_000_000  # longest delay until a requested mode shows


class ModeOwnership:
    """Distinguishes mode changes by slz from those by the pilot.

    The guided mode is ours, unless it shows unrequested after the landing mode that we requested. A landing
    mode is ours after we requested it. A mode that we asked the vehicle to leave is ours until it is left.
    """

    def __init__(self) -> None:
        self._land_ns: int | None = None
        self._leaving: str | None = None
        self._shown = False  # the landing mode has shown since we requested it
        self._lands = False  # it was entered at our request, and no other mode was requested since

    def on_land_request(self, s: Situation) -> None:
        """Record a request for the landing mode."""
        self._land_ns, self._leaving, self._lands, self._shown = s.now_ns, None, False, False

    def on_leave_request(self, s: Situation) -> None:
        """Record a request to leave the present mode for the guided mode."""
        self._leaving = None if s.guided else s.mode

    def on_guided_request(self) -> None:
        """Record a request to leave the landing mode."""
        self._lands = False

    def adopt_landing(self, s: Situation) -> None:
        """Take over the present landing mode, which a previous companion requested."""
        self.on_land_request(s)
        self._lands = self._shown = True

    def clear(self) -> None:
        """Clear all requests."""
        self._land_ns, self._leaving, self._lands = None, None, False

    def lands_for_us(self, s: Situation) -> bool:
        """Return whether the vehicle is in the landing mode at our request."""
        return s.landing and self._shown and self._land_ns is not None

    def is_taken_away(self, s: Situation) -> bool:
        """Return whether somebody else chose the present mode."""
        if s.guided:
            self._leaving = None
            if self._lands:
                return True
            # Only a fresh heartbeat shows that the landing mode was not entered.
            late = s.heard and self._land_ns is not None and s.now_ns - self._land_ns > SETTLE_NS
            if self._shown or late:
                self._land_ns = None
            return False
        if s.landing and self._land_ns is not None:
            if not self._shown:  # if shown before, it may have been asked to leave since
                self._shown = self._lands = True
            return False
        return s.mode != self._leaving


class HandOver:
    """Tracks the flight mode from step to step.

    The guided mode is a hand-over if it was set at the start of the companion, was set on the ground, or is
    chosen in the air. It does not count if the autopilot returns to it after a failsafe of its own, as PX4
    does when setpoints arrive again, nor while the vehicle must not be commanded; the pilot then has to
    choose it once more.

    Attributes
    ----------
    given
        Whether the vehicle is handed over.
    asked_ns
        Last time at which the pilot was asked for a hand-over.
    """

    def __init__(self) -> None:
        self.given = True
        self.asked_ns: int | None = None
        self._guided: bool | None = None
        self._failsafe = False

    def follow(self, s: Situation) -> None:
        """Update from the present situation."""
        if not s.connected or not s.heard:
            return
        failsafe = s.failsafe or s.breached or bool(s.no_command_reason)
        if not s.armed or s.on_ground is True:
            self.given = True
        elif failsafe:
            self.given = False
        elif s.guided and self._guided is False and not self._failsafe:
            self.given = True
        self._guided, self._failsafe = s.guided, failsafe

    def end(self) -> None:
        """End the hand-over: the next one is needed."""
        self.given = False
