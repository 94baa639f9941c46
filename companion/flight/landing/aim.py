"""The point flown to: where it is, how far away, and whether the newest report finds it safe."""

from __future__ import annotations

import numpy as np

from companion.flight.landing.situation import Vector
from slz import PointState, SelectedPoint

SAME_PLACE_M = 0.01


class Aim:
    """A landing point, with the ground under it as last measured.

    Attributes
    ----------
    enu_m
        East, north, up in the map frame (3,), or None while there is none.
    height_left_m, away_m
        The vehicle's height over the ground at the point, and horizontal distance to it; infinite while
        unknown.
    """

    def __init__(self) -> None:
        self.enu_m: Vector | None = None
        self.height_left_m = self.away_m = float("inf")
        self._ground_m: float | None = None

    def take(self, enu_m: Vector) -> None:
        """Aim at another point."""
        self.enu_m, self._ground_m = np.asarray(enu_m, np.float64), None

    def move(self, jump_enu_m: Vector) -> None:
        """Follow a jump of the position estimate."""
        if self.enu_m is not None:
            self.enu_m = self.enu_m + jump_enu_m
            self._ground_m = None if self._ground_m is None else self._ground_m + float(jump_enu_m[2])

    def measure(self, position_enu_m: Vector | None, selected: SelectedPoint | None) -> None:
        """Take the ground from the newest report, if that is about this point, and the distances to it."""
        if self.enu_m is None:
            return
        if self.is_at(selected) and selected is not None and np.isfinite(selected.height_m):
            self._ground_m = float(selected.height_m)
        if position_enu_m is not None:
            offset = self.on_ground_enu_m - position_enu_m
            self.height_left_m, self.away_m = -float(offset[2]), float(np.hypot(*offset[:2]))

    @property
    def on_ground_enu_m(self) -> Vector:
        """The point (3,) on the ground as last measured; as high as it was given before that."""
        if self.enu_m is None:
            raise RuntimeError("no point to fly to")
        up_m = self.enu_m[2] if self._ground_m is None else self._ground_m
        return np.array([self.enu_m[0], self.enu_m[1], up_m])

    def is_at(self, selected: SelectedPoint | None) -> bool:
        """Whether a report's selected point is this one."""
        return selected is not None and self.enu_m is not None and same_place(selected.enu_m, self.enu_m)

    def judgement(self, selected: SelectedPoint | None) -> PointState:
        """State of the point in the newest report; unknown while that report is about another point.

        What the far map says is no ground to land on.
        """
        if selected is None or not self.is_at(selected) or selected.judged_by == "far":
            return PointState.UNKNOWN
        return selected.state


def same_place(a: Vector, b: Vector) -> bool:
    """Whether two points are horizontally one."""
    return float(np.hypot(*(a[:2] - b[:2]))) <= SAME_PLACE_M
