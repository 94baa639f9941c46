"""A ball that is kicked across the landing point: it bounces, rolls and stops."""

from __future__ import annotations

import math

from sitl.intruders.crosser import BESIDE_M, FROM_M, even_bearing
from sitl.intruders.intruder import Intruder, SimulatedFlight
from sitl.world.primitives import Ellipsoid, Kind

GRAVITY = 9.81
RADIUS_M = (0.125, 0.2)
SPEED_MS = (6.0, 12.0)
RISE_MS = (1.0, 4.0)
"""Speed upward at the kick."""
RESTITUTION = 0.6  # of the speed; FIFA's test of turf: 0.6 to 0.85 m after a fall of 2 m
SLOWED = 0.8  # share of the speed along the ground that a bounce leaves
ROLLING = 0.06  # deceleration of a rolling ball on grass, of the weight: 4 to 10 m of roll in FIFA's test
LEAST_RISE_MS = 0.4  # below which it rolls


def path_m(speed_ms: float, rise_ms: float, since_s: float) -> tuple[float, float, bool]:
    """Return the way along the ground, the height of the lowest point over it, and whether the ball rests.

    It flies in parabolas without drag. Each bounce takes its share of both speeds; then it rolls.
    """
    gone, left = 0.0, since_s
    while rise_ms > LEAST_RISE_MS:
        flight_s = 2.0 * rise_ms / GRAVITY
        if left < flight_s:
            return gone + speed_ms * left, left * (rise_ms - 0.5 * GRAVITY * left), False
        gone, left = gone + speed_ms * flight_s, left - flight_s
        rise_ms, speed_ms = RESTITUTION * rise_ms, SLOWED * speed_ms
    rolls_s = speed_ms / (ROLLING * GRAVITY)
    rolled = min(left, rolls_s)
    return gone + rolled * (speed_ms - 0.5 * ROLLING * GRAVITY * rolled), 0.0, left >= rolls_s


class BouncingBall(Intruder):
    """Ball of 0.25 to 0.4 m that comes from `FROM_M` away or less and passes the point or stops near it."""

    what = "ball"
    end = "has stopped"

    def start(self, s: SimulatedFlight) -> None:
        radius = float(self.rng.uniform(*RADIUS_M))
        self._speed_ms, self._rise_ms = (float(self.rng.uniform(*v)) for v in (SPEED_MS, RISE_MS))
        self._beside_m = float(self.rng.uniform(-BESIDE_M, BESIDE_M)) / 2
        self._from_m = min(FROM_M, float(self.rng.uniform(0.6, 0.9)) * self._reach_m())
        self._bearing = even_bearing(self.rng, s, self._at)
        ball = Ellipsoid(0.0, 0.0, radius, radius, radius, radius, Kind.WOOD, "ball")
        s.scene.world.add_mover(self.what, (ball,), *self._at(0.0, self._bearing), 0.0)

    def move(self, s: SimulatedFlight, since_s: float) -> bool:
        gone_m, over_m, rests = path_m(self._speed_ms, self._rise_ms, since_s)
        s.scene.world.move(self.what, *self._at(gone_m, self._bearing), 0.0, over_m)
        return rests

    def _reach_m(self) -> float:
        return path_m(self._speed_ms, self._rise_ms, math.inf)[0]

    def _at(self, gone_m: float, bearing: float) -> tuple[float, float]:
        along, (x, y) = gone_m - self._from_m, self.goal
        c, n = math.cos(bearing), math.sin(bearing)
        return x + along * c - self._beside_m * n, y + along * n + self._beside_m * c
