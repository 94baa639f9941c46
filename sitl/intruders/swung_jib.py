"""A crane's jib that swings over the vehicle: an obstacle above it, with air below."""

from __future__ import annotations

import math

from sitl.intruders.intruder import Intruder, SimulatedFlight
from sitl.world.primitives import Box, Kind

REACH_M = 35.0
BEYOND_M = 5.0  # of the landing point
SLEW_RAD_S = 0.08  # of tower cranes: 0.6 to 0.8 turns a minute
SWING_RAD = math.radians(40.0)
OVER_M = 5.0  # its underside over the vehicle when it begins to turn


class SwungJib(Intruder):
    """Jib that swings over the landing point, `OVER_M` over where the vehicle was when it began to."""

    what = "jib"

    def start(self, s: SimulatedFlight) -> None:
        bearing = self.rng.uniform(-math.pi, math.pi)
        away = REACH_M - BEYOND_M
        self._mast = self.goal[0] - away * math.cos(bearing), self.goal[1] - away * math.sin(bearing)
        self._side, self._bearing = (1.0 if self.rng.random() < 0.5 else -1.0), bearing
        foot = s.scene.world.height_m(*self._mast)
        under_m = float(s.vehicle.truth.pos_enu_m[2]) + OVER_M - foot
        mast = Box(0.0, 0.0, 0.0, 1.5, 1.5, under_m, kind=Kind.METAL, name="mast")
        jib = Box(REACH_M / 2, 0.0, under_m, REACH_M, 1.2, 1.2, kind=Kind.METAL, name="jib")
        s.scene.world.add_mover(self.what, (mast, jib), *self._mast, bearing + self._side * SWING_RAD)

    def move(self, s: SimulatedFlight, since_s: float) -> bool:
        left = max(0.0, SWING_RAD - SLEW_RAD_S * since_s)
        s.scene.world.move(self.what, *self._mast, self._bearing + self._side * left)
        return left == 0.0
