"""Bodies that come to a landing: what crosses on the ground, a ball, a car, the jib of a crane."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from sitl.intruders.intruder import Intruder, SimulatedFlight
from sitl.world.primitives import Box, Ellipsoid, Kind
from sitl.world.world import CAR

FROM_M = 18.0
BESIDE_M = 2.5  # greatest distance from the point at which it passes
STEEPEST_M = 4.0  # difference of heights along a way: walls and roofs are not crossed
TRIES = 24
GRAVITY = 9.81
RADIUS_M = (0.125, 0.2)
BALL_SPEED_MS = (6.0, 12.0)
RISE_MS = (1.0, 4.0)
"""Speed upward at the kick."""
RESTITUTION = 0.6  # of the speed; FIFA's test of turf: 0.6 to 0.85 m after a fall of 2 m
SLOWED = 0.8  # share of the speed along the ground that a bounce leaves
ROLLING = 0.06  # deceleration of a rolling ball on grass, of the weight: 4 to 10 m of roll in FIFA's test
LEAST_RISE_MS = 0.4  # below which it rolls
CAR_SPEED_MS = 6.0
CAR_FROM_M = 25.0
REACH_M = 35.0
BEYOND_M = 5.0  # of the landing point
SLEW_RAD_S = 0.08  # of tower cranes: 0.6 to 0.8 turns a minute
SWING_RAD = math.radians(40.0)
OVER_M = 5.0  # its underside over the vehicle when it begins to turn


def even_bearing(
    rng: np.random.Generator, s: SimulatedFlight, place: Callable[[float, float], tuple[float, float]]
) -> float:
    """Return the most even of some bearings drawn; `place` is that after a way (m) on a bearing."""
    along = np.linspace(0, 2 * FROM_M, 60)
    best, least = 0.0, math.inf
    for bearing in rng.uniform(-math.pi, math.pi, TRIES):
        way = np.array([place(float(gone), float(bearing)) for gone in along])
        z, _ = s.scene.world.surface(way[:, 0], way[:, 1])
        rough = float(np.nan_to_num(np.ptp(z), nan=1e3))
        if rough < least:
            best, least = float(bearing), rough
        if rough < STEEPEST_M / 10:
            break
    return best


class Crosser(Intruder):
    """Object that comes from `FROM_M` away, passes the point within `BESIDE_M`, and goes as far beyond."""

    end = "gone by"
    parts: tuple[Box, ...]
    speed_ms: tuple[float, float]

    def start(self, s: SimulatedFlight) -> None:
        self._speed_ms = float(self.rng.uniform(*self.speed_ms))
        self._beside_m = float(self.rng.uniform(-BESIDE_M, BESIDE_M))
        self._bearing = even_bearing(self.rng, s, self._at)
        s.scene.world.add_mover(self.what, self.parts, *self._at(0.0, self._bearing), self._bearing)

    def move(self, s: SimulatedFlight, since_s: float) -> bool:
        gone_m = min(2 * FROM_M, self._speed_ms * since_s)
        s.scene.world.move(self.what, *self._at(gone_m, self._bearing), self._bearing)
        return gone_m == 2 * FROM_M

    def _at(self, gone_m: float, bearing: float) -> tuple[float, float]:
        along, (x, y) = gone_m - FROM_M, self.goal
        c, n = math.cos(bearing), math.sin(bearing)
        return x + along * c - self._beside_m * n, y + along * n + self._beside_m * c


def _upright(length_m: float, width_m: float, height_m: float, foot_m: float, name: str) -> Box:
    return Box(0.0, 0.0, foot_m, length_m, width_m, height_m, kind=Kind.WOOD, name=name)


class Walker(Crosser):
    """Person on foot."""

    what = "walker"
    parts = (_upright(0.3, 0.45, 1.45, 0.0, "body"), _upright(0.2, 0.18, 0.3, 1.45, "head"))
    speed_ms = (0.9, 1.8)


class Runner(Walker):
    """Person who runs."""

    what = "runner"
    speed_ms = (2.5, 4.5)


class Dog(Crosser):
    """Dog of medium size."""

    what = "dog"
    parts = (_upright(0.8, 0.25, 0.4, 0.2, "body"), _upright(0.7, 0.2, 0.2, 0.0, "legs"))
    speed_ms = (1.5, 6.0)


class Cyclist(Crosser):
    """Person on a bicycle."""

    what = "cyclist"
    parts = (_upright(1.7, 0.15, 1.0, 0.0, "bicycle"), _upright(0.5, 0.45, 0.85, 0.9, "rider"))
    speed_ms = (3.0, 7.0)


class PassingCar(Crosser):
    """Car that drives across."""

    what = "passing_car"
    parts = CAR
    speed_ms = (4.0, 10.0)


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
        self._speed_ms, self._rise_ms = (float(self.rng.uniform(*v)) for v in (BALL_SPEED_MS, RISE_MS))
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


class DrivenCar(Intruder):
    """Car that drives from 25 m away onto the landing point, along the most even ground."""

    what = "car"

    def start(self, s: SimulatedFlight) -> None:
        self._bearing = self._clear_way(s)
        s.scene.world.add_car(self.what, *self._at(CAR_FROM_M), self._bearing + math.pi)

    def move(self, s: SimulatedFlight, since_s: float) -> bool:
        left = max(0.0, CAR_FROM_M - CAR_SPEED_MS * since_s)
        s.scene.world.move(self.what, *self._at(left), self._bearing + math.pi)
        return left == 0.0

    def _at(self, away_m: float) -> tuple[float, float]:
        x, y = self.goal
        return x + away_m * math.cos(self._bearing), y + away_m * math.sin(self._bearing)

    def _clear_way(self, s: SimulatedFlight) -> float:
        """Return the bearing along which the ground towards the goal is most even."""
        bearings = np.linspace(0, 2 * np.pi, 16, endpoint=False)
        along = np.linspace(0, CAR_FROM_M, 30)
        rough = []
        for bearing in bearings:
            z, _ = s.scene.world.surface(
                self.goal[0] + along * np.cos(bearing), self.goal[1] + along * np.sin(bearing)
            )
            rough.append(float(np.nan_to_num(np.ptp(z), nan=1e3)))
        return float(bearings[int(np.argmin(rough))])


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
