"""Way out after an abort: straight up, or aside along a clear way where something is above."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from companion.flight.landing.situation import Situation, Vector, known
from companion.flight.landing.ways.approach_path import ApproachPath
from params import Parameters
from slz import SAFE, Corridors

PAST_M = 2.0  # beyond the vehicle's own size, aside of the last place with something above
LEAST_DEG = 20.0  # steepness of a way out whose air nobody judged: level flight would not leave what is above


class WayOut:
    """Velocity of a climb which never leads into what was seen above.

    The vehicle climbs straight up. With something above it leaves aside, along the path that it came down,
    else along the clear way that is nearest to straight up, until it is past what was above.
    """

    def __init__(self, parameters: Parameters) -> None:
        self._p = parameters
        self._blocked_at_m: Vector | None = None  # (2,) last place with something above
        self._outward: Vector | None = None
        self._rise = 1.0

    def reset(self) -> None:
        """Forget the climb before."""
        self._blocked_at_m = self._outward = None

    @property
    def leads_aside(self) -> bool:
        """True if the vehicle leaves aside at present."""
        return self._blocked_at_m is not None and self._outward is not None

    def velocity_enu_ms(
        self, s: Situation, position_enu_m: Vector, path: ApproachPath | None, corridors: Corridors | None
    ) -> Vector:
        """Return the velocity (3,) of the climb.

        Parameters
        ----------
        path
            The approach path of the descent, None if that was straight down.
        corridors
            Of the point that is left, None where nobody judged them.
        """
        p = self._p
        if s.blocked_above:
            self._blocked_at_m = position_enu_m[:2].copy()
            self._outward, self._rise = self._outward_way(s, path, corridors)
        if self._blocked_at_m is not None:
            past_m = max(p.footprint_m, p.greatest_dimension_m) + PAST_M
            if float(np.hypot(*(position_enu_m[:2] - self._blocked_at_m))) > past_m:
                self.reset()
        if self._outward is None:
            return np.array([0.0, 0.0, p.climb_speed_ms])
        aside_ms = min(p.approach_speed_ms, p.climb_speed_ms / self._rise)
        return np.array([*(aside_ms * self._outward), min(p.climb_speed_ms, aside_ms * self._rise)])

    def _outward_way(
        self, s: Situation, path: ApproachPath | None, corridors: Corridors | None
    ) -> tuple[Vector | None, float]:
        """Return the direction (2,) of the way out and the tangent of its slope; None without one."""
        if path is not None:
            return path.outward, path.rise
        if corridors is None:
            return None, 1.0
        clear = corridors.states[:, :-1] == SAFE
        clear[~self._inside_fence(s, len(clear))] = False
        if not clear.any():
            return None, 1.0
        slopes = clear.shape[1] - 1 - clear[:, ::-1].argmax(axis=1)
        steepest = np.where(clear.any(axis=1), slopes, -1)
        bearing = math.radians(int(steepest.argmax()) * 360 / len(steepest))
        slope_deg = max(LEAST_DEG, corridors.slopes_deg[int(steepest.max())])
        return np.array([math.sin(bearing), math.cos(bearing)]), math.tan(math.radians(slope_deg))

    def _inside_fence(self, s: Situation, n_bearings: int) -> NDArray[np.bool_]:
        """Return along which bearings (n,) the vehicle stays inside the autopilot's fence on its way out."""
        bearings = 2 * np.pi * np.arange(n_bearings) / n_bearings
        past_m = max(self._p.footprint_m, self._p.greatest_dimension_m) + PAST_M
        ends = known(s.position_enu_m)[:2] + past_m * np.stack([np.sin(bearings), np.cos(bearings)], axis=1)
        return np.asarray(s.fence.room_m(ends) >= 0)
