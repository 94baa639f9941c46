"""Target point of a landing and the selected point: position, distance, and state in the newest report."""

from __future__ import annotations

import numpy as np

from companion.flight.landing.situation import Situation, Vector
from params import Parameters
from slz import PointState, SelectedPoint

SAME_PLACE_M = 0.01


class Aim:
    """Target point, with the ground height under it as last measured.

    Attributes
    ----------
    enu_m
        East, north, up in the map frame (3,), None without a target.
    height_left_m, away_m
        Height of the vehicle above ground at the point, and horizontal distance to it; infinite while
        unknown.
    """

    def __init__(self) -> None:
        self.enu_m: Vector | None = None
        self.height_left_m = self.away_m = float("inf")
        self._ground_m: float | None = None

    def set_target(self, enu_m: Vector) -> None:
        """Set a new target point."""
        self.enu_m, self._ground_m = np.asarray(enu_m, np.float64), None

    def move(self, jump_enu_m: Vector) -> None:
        """Shift the target by a jump of the position estimate."""
        if self.enu_m is not None:
            self.enu_m = self.enu_m + jump_enu_m
            self._ground_m = None if self._ground_m is None else self._ground_m + float(jump_enu_m[2])

    def follow(self, s: Situation) -> None:
        """Update the ground height, if the newest report judges this point, and the distances."""
        position_enu_m, selected = s.position_enu_m, s.selected
        if self.enu_m is None:
            return
        if self.is_at(selected) and selected is not None and np.isfinite(selected.height_m):
            self._ground_m = float(selected.height_m)
        if position_enu_m is not None:
            offset = self.on_ground_enu_m - position_enu_m
            self.height_left_m, self.away_m = -float(offset[2]), float(np.hypot(*offset[:2]))

    @property
    def on_ground_enu_m(self) -> Vector:
        """The point (3,) at the measured ground height, or at its given height before a measurement."""
        if self.enu_m is None:
            raise RuntimeError("no point to fly to")
        up_m = self.enu_m[2] if self._ground_m is None else self._ground_m
        return np.array([self.enu_m[0], self.enu_m[1], up_m])

    def is_at(self, selected: SelectedPoint | None) -> bool:
        """Return whether a report's selected point is this one."""
        return selected is not None and self.enu_m is not None and same_place(selected.enu_m, self.enu_m)

    def is_low(self, parameters: Parameters) -> bool:
        """Return whether only dust would be seen of the point, or the landing is committed."""
        return self.height_left_m <= committed_m(parameters)

    def judgement(self, selected: SelectedPoint | None) -> PointState:
        """Return the state of the point in the newest report; unknown if that judges another point.

        A judgement by the far map counts as unknown: landing needs the near map.
        """
        if selected is None or not self.is_at(selected) or selected.judged_by == "far":
            return PointState.UNKNOWN
        return selected.state


class PointSelection:
    """Newest selected point, and whether the pipeline is still to be asked to judge it."""

    def __init__(self) -> None:
        self._newest: Vector | None = None
        self._pending = False

    def select(self, enu_m: Vector | None) -> None:
        """Select a point: the pipeline judges it from its next report on."""
        self._newest, self._pending = enu_m, enu_m is not None

    def clear(self) -> bool:
        """Clear the selection; return whether there was one."""
        had_one = self._newest is not None
        self.select(None)
        return had_one

    @property
    def enu_m(self) -> Vector | None:
        """Newest selected point (3,), None without one."""
        return self._newest

    def collect(self) -> Vector | None:
        """Return the point to send to the pipeline, once after each selection."""
        pending, self._pending = self._pending, False
        return self._newest if pending else None

    def is_judged_by(self, selected: SelectedPoint | None) -> bool:
        """Return whether a report's selected point is the newest one, or nothing else was selected."""
        return self._newest is None or (selected is not None and same_place(selected.enu_m, self._newest))


def same_place(a: Vector, b: Vector) -> bool:
    """Return whether two points are at the same horizontal position."""
    return float(np.hypot(*(a[:2] - b[:2]))) <= SAME_PLACE_M


def committed_m(parameters: Parameters) -> float:
    """Return the height over the point below which its last verified state holds."""
    return max(parameters.commit_height_m, parameters.dust_height_m)
