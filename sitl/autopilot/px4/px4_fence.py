"""Geofence of PX4: distances from home by GF_MAX_HOR_DIST and GF_MAX_VER_DIST, and areas (geofence.cpp)."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from sitl.autopilot.fence import AREAS, CEILING, CIRCLE, Fence

F64 = NDArray[np.float64]


class Px4Fence(Fence):
    """Fence that only reports; nothing stops before it, GF_ACTION acts beyond it."""

    @property
    def kinds(self) -> int:
        """Bits of the fences that are configured and present."""
        kinds = CIRCLE if self.parameters["GF_MAX_HOR_DIST"] > 0 else 0
        kinds |= CEILING if self.parameters["GF_MAX_VER_DIST"] > 0 else 0
        return kinds | (AREAS if self.items.items else 0)

    @property
    def enabled(self) -> bool:
        return bool(self.kinds)

    def look(self, position_enu_m: F64, home_enu_m: F64) -> bool:
        """Check the position; return whether it is beyond the fence."""
        p = self.parameters
        east, north, up = (float(v) for v in position_enu_m - home_enu_m)
        outside = CIRCLE if math.hypot(east, north) > p["GF_MAX_HOR_DIST"] else 0
        outside |= CEILING if up > p["GF_MAX_VER_DIST"] else 0
        if self.kinds & AREAS and self._is_out_of_areas(position_enu_m[:2]):
            outside |= AREAS
        self.breached = outside & self.kinds
        return bool(self.breached)
