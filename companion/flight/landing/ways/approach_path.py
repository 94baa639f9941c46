"""Approach path: a straight way of one slope down to a hover over the landing point."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from companion.flight.landing.guidance import level, towards
from companion.flight.landing.situation import Vector
from params import Parameters

HOVER_OVER_M = 2.0  # the hover at the end over the height below which the ground is not judged any more
ASIDE_GAIN_PER_S, ASIDE_MS = 0.4, 2.0  # velocity back onto the path
ON_PATH_M, OFF_PATH_M = 1.0, 4.0  # error of height up to which the speed is kept, and from which it is zero


@dataclass(frozen=True, slots=True)
class ApproachPath:
    """A way down to a point.

    bearing_deg: from the point, clockwise from north. slope_deg: of the path. hover_m: height over the point
    at its end. length_m: horizontal distance of its beginning.
    """

    bearing_deg: float
    slope_deg: float
    hover_m: float
    length_m: float

    @property
    def outward(self) -> Vector:
        """Unit vector (2,) east, north from the point along the path."""
        bearing = math.radians(self.bearing_deg)
        return np.array([math.sin(bearing), math.cos(bearing)])

    @property
    def inbound_rad(self) -> float:
        """Course of a vehicle on its way in, clockwise from north."""
        return math.radians((self.bearing_deg + 180) % 360)

    @property
    def rise(self) -> float:
        """Tangent of the slope."""
        return math.tan(math.radians(self.slope_deg))

    def speed_ms(self, p: Parameters) -> float:
        """Return the horizontal speed along the path; the descent then does not exceed `descent_speed_ms`."""
        return min(p.approach_speed_ms, p.descent_speed_ms / self.rise)

    def height_m(self, away_m: float) -> float:
        """Return the height of the path over the point at a horizontal distance along it."""
        return self.hover_m + self.rise * max(0.0, away_m)

    def entry_offset_m(self, position_enu_m: Vector, point_enu_m: Vector) -> Vector:
        """Return the horizontal offset (2,) from a position to the beginning of the path."""
        return np.asarray(point_enu_m[:2] + self.length_m * self.outward - position_enu_m[:2])

    def aside_m(self, position_enu_m: Vector, point_enu_m: Vector) -> float:
        """Return the horizontal distance of a position from the path's line."""
        return abs(float(np.dot(position_enu_m[:2] - point_enu_m[:2], _right(self.outward))))

    def velocity_enu_ms(
        self, position_enu_m: Vector, now_enu_ms: Vector, point_enu_m: Vector, parameters: Parameters
    ) -> Vector:
        """Return the velocity (3,) along the path towards the point, at the present one.

        The speed is such that the descent does not exceed `descent_speed_ms`; off the path's height it falls,
        to zero at 4 m, so that the vehicle joins the path before it follows it.
        """
        p, offset = parameters, position_enu_m - point_enu_m
        along, aside = float(offset[:2] @ self.outward), float(offset[:2] @ _right(self.outward))
        error_m = self.height_m(along) - float(offset[2])
        share = 1 - (abs(error_m) - ON_PATH_M) / (OFF_PATH_M - ON_PATH_M)
        speed_ms = self.speed_ms(p) * min(1.0, max(0.0, share))
        outward_ms = float(now_enu_ms[:2] @ self.outward)
        inward = towards(-along * self.outward, speed_ms, outward_ms * self.outward)
        back_ms = max(-ASIDE_MS, min(ASIDE_MS, -ASIDE_GAIN_PER_S * aside))
        falls_ms = self.rise * float(inward @ self.outward) if along > 0 else 0.0  # negative on the way in
        climb_ms = level(error_m, p.descent_speed_ms) + falls_ms
        climb_ms = max(-p.descent_speed_ms, min(p.climb_speed_ms, climb_ms))
        return np.array([*(inward + back_ms * _right(self.outward)), climb_ms])


def hover_height_m(parameters: Parameters) -> float:
    """Return the height over the point at which a path ends, and the autopilot's LAND takes over."""
    p = parameters
    return min(p.final_height_m, max(p.dust_height_m, p.commit_height_m) + HOVER_OVER_M)


def _right(way: Vector) -> Vector:
    return np.array([way[1], -way[0]])
