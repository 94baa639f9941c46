"""Horizontal wind."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

WindSource = Literal["autopilot", "tilt"]


@dataclass(frozen=True, slots=True)
class Wind:
    """Horizontal wind at the vehicle.

    Attributes
    ----------
    from_rad
        Direction from which it blows, rad clockwise from north: the heading into the wind.
    speed_ms, gust_ms
        Speed of the mean wind, and the greatest mean over 3 s of the last minute.
    source
        The autopilot's own estimate, or the vehicle's tilt.
    """

    from_rad: float
    speed_ms: float
    gust_ms: float
    source: WindSource

    @classmethod
    def of_velocity(cls, east_ms: float, north_ms: float, gust_ms: float, source: WindSource) -> Wind:
        """Return the wind whose air moves with a velocity towards east and north."""
        from_rad = math.atan2(-east_ms, -north_ms) % (2 * math.pi)
        return cls(from_rad, math.hypot(east_ms, north_ms), gust_ms, source)

    @property
    def towards_enu_ms(self) -> NDArray[np.float64]:
        """Velocity of the air (2,) east, north."""
        return -self.speed_ms * np.array([math.sin(self.from_rad), math.cos(self.from_rad)])
