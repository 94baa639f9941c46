"""Detector of the pilot's hand-over to a companion that lands without an order."""

from __future__ import annotations

from companion.flight.landing.situation import Situation


class HandOver:
    """Tracks the flight mode from step to step.

    The guided mode is a hand-over if it was set at the start of the companion, was set on the ground, or is
    chosen in the air. It does not count if the autopilot returns to it after a failsafe of its own, as PX4
    does when setpoints arrive again, nor while the vehicle must not be commanded; the pilot then has to
    choose it once more.
    """

    def __init__(self) -> None:
        self.given = True
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
