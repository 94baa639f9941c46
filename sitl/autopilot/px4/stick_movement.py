"""Speed of the sticks, by which a pilot takes over (manual_control/MovingDiff.hpp)."""

from __future__ import annotations

from sitl.autopilot.radio_receiver import Sticks

FILTER_S = 0.1


class StickMovement:
    """Low-passed speed of each stick's deflection, per second."""

    def __init__(self) -> None:
        self._last: tuple[float, ...] | None = None
        self._speeds: tuple[float, ...] = (0.0,) * 4

    def reset(self) -> None:
        """Forget the sticks, which were lost."""
        self._last, self._speeds = None, (0.0,) * 4

    def update(self, sticks: Sticks, dt_s: float) -> float:
        """Return the speed of the fastest stick."""
        now = sticks.right, sticks.forward, sticks.up, sticks.clockwise
        before = now if self._last is None else self._last
        share = dt_s / (FILTER_S + dt_s)
        self._speeds = tuple(
            speed + share * ((new - old) / dt_s - speed)
            for speed, new, old in zip(self._speeds, now, before, strict=True)
        )
        self._last = now
        return max(abs(speed) for speed in self._speeds)
