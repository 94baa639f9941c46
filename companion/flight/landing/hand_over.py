"""Whether the pilot has handed over to a companion that lands without further word."""

from __future__ import annotations

from companion.flight.landing.situation import Situation


class HandOver:
    """Follows the flight mode from step to step.

    The guided mode is a hand-over if it was there when the companion started, was set on the ground, or is
    chosen in the air. It is none when the autopilot returns to it out of a failsafe of its own, as PX4 does
    when setpoints arrive again; then the pilot has to choose it once more.
    """

    def __init__(self) -> None:
        self.given = True
        self._guided: bool | None = None
        self._failsafe = False

    def follow(self, s: Situation) -> None:
        """Take what is known at this step."""
        if not s.connected or not s.heard:
            return
        failsafe = s.failsafe or s.breached
        if not s.armed or s.on_ground is True:
            self.given = True
        elif failsafe:
            self.given = False
        elif s.guided and self._guided is False and not self._failsafe:
            self.given = True
        self._guided, self._failsafe = s.guided, failsafe

    def withdraw(self) -> None:
        """Wait for the next hand-over: this one is over."""
        self.given = False
