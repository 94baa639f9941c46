"""Walkers, runners, dogs, cyclists and cars that cross the landing point, or pass beside it."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from sitl.intruders.intruder import Intruder, SimulatedFlight
from sitl.world.primitives import Box, Kind
from sitl.world.world import CAR

FROM_M = 18.0
BESIDE_M = 2.5  # greatest distance from the point at which it passes
STEEPEST_M = 4.0  # difference of heights along a way: walls and roofs are not crossed
TRIES = 24


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
