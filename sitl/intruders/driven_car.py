"""A car that drives onto the landing point during the descent."""

from __future__ import annotations

import math

import numpy as np

from sitl.intruders.intruder import Intruder, SimulatedFlight

SPEED_MS = 6.0
FROM_M = 25.0


class DrivenCar(Intruder):
    """Car that drives from 25 m away onto the landing point, along the most even ground."""

    what = "car"

    def start(self, s: SimulatedFlight) -> None:
        self._bearing = self._clear_way(s)
        s.scene.world.add_car(self.what, *self._at(FROM_M), self._bearing + math.pi)

    def move(self, s: SimulatedFlight, since_s: float) -> bool:
        left = max(0.0, FROM_M - SPEED_MS * since_s)
        s.scene.world.move(self.what, *self._at(left), self._bearing + math.pi)
        return left == 0.0

    def _at(self, away_m: float) -> tuple[float, float]:
        x, y = self.goal
        return x + away_m * math.cos(self._bearing), y + away_m * math.sin(self._bearing)

    def _clear_way(self, s: SimulatedFlight) -> float:
        """Return the bearing along which the ground towards the goal is most even."""
        bearings = np.linspace(0, 2 * np.pi, 16, endpoint=False)
        along = np.linspace(0, FROM_M, 30)
        rough = []
        for bearing in bearings:
            z, _ = s.scene.world.surface(
                self.goal[0] + along * np.cos(bearing), self.goal[1] + along * np.sin(bearing)
            )
            rough.append(float(np.nan_to_num(np.ptp(z), nan=1e3)))
        return float(bearings[int(np.argmin(rough))])
