"""Closed forms of the surface of frozen scenes: each shape raises or lowers the ground at its place.

The surface is the ground plus the rise of every shape, at any point. A shape is data: `scene.json` holds the
same numbers, so that another program can compute the same surface.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple, Protocol

import numpy as np

from companion.desk.open_benchmark.landing_task import F64

WAVES = ((0.9, 1.3, 0.0), (-1.7, 0.8, 1.0), (0.5, -0.45, 2.0))
"""Wavelengths in x and y (m) and phase (rad) of the texture of all ground, such as grass."""
CRATER_DEPTH, CRATER_RIM, RIM_REACH = 0.2, 0.036, 1.6
"""Depth and rim height over the diameter of a fresh simple crater, and where the rim ends over the radius."""


class Circle(NamedTuple):
    """Circle that holds all of a shape; outside it the rise is 0."""

    x_m: float
    y_m: float
    radius_m: float


EVERYWHERE = Circle(0.0, 0.0, math.inf)


class Shape(Protocol):
    """Part of the surface."""

    @property
    def kind(self) -> str: ...

    @property
    def bounds(self) -> Circle: ...

    def rise_m(self, x: F64, y: F64) -> F64:
        """Return the height (m) by which it raises the ground at points of any shape."""


@dataclass(frozen=True, slots=True)
class Ground:
    """Inclined plane with texture: steepest ascent at an angle from east, height 0 at the origin."""

    slope_deg: float
    ascent_deg: float = 30.0
    texture_m: float = 0.008

    def height_m(self, x: F64, y: F64) -> F64:
        a = np.radians(self.ascent_deg)
        z = np.tan(np.radians(self.slope_deg)) * (x * np.cos(a) + y * np.sin(a))
        for length_x, length_y, phase in WAVES:
            z = z + self.texture_m / 2 * np.sin(2 * np.pi * (x / length_x + y / length_y) + phase)
        return np.asarray(z)


def _turned(x: F64, y: F64, x0: float, y0: float, turn_deg: float) -> tuple[F64, F64]:
    """Return coordinates along and across an axis through a place, turned from east."""
    a = np.radians(turn_deg)
    along = (x - x0) * np.cos(a) + (y - y0) * np.sin(a)
    return along, (y - y0) * np.cos(a) - (x - x0) * np.sin(a)


@dataclass(frozen=True, slots=True)
class Step:
    """Half-plane on the left of an axis: a kerb."""

    kind: str
    x_m: float
    y_m: float
    turn_deg: float
    height_m: float

    @property
    def bounds(self) -> Circle:
        return EVERYWHERE

    def rise_m(self, x: F64, y: F64) -> F64:
        return np.where(_turned(x, y, self.x_m, self.y_m, self.turn_deg)[1] > 0, self.height_m, 0.0)


@dataclass(frozen=True, slots=True)
class Slab:
    """Rectangle of one height: a wall, a car's body, a building; of negative height a ditch."""

    kind: str
    x_m: float
    y_m: float
    turn_deg: float
    length_m: float
    width_m: float
    height_m: float

    @property
    def bounds(self) -> Circle:
        return Circle(self.x_m, self.y_m, math.hypot(self.length_m, self.width_m) / 2)

    def rise_m(self, x: F64, y: F64) -> F64:
        along, across = _turned(x, y, self.x_m, self.y_m, self.turn_deg)
        inside = (np.abs(along) <= self.length_m / 2) & (np.abs(across) <= self.width_m / 2)
        return np.where(inside, self.height_m, 0.0)


@dataclass(frozen=True, slots=True)
class Disc:
    """Disc of one height: a pole; of negative height a hole, or a pond's level."""

    kind: str
    x_m: float
    y_m: float
    diameter_m: float
    height_m: float

    @property
    def bounds(self) -> Circle:
        return Circle(self.x_m, self.y_m, self.diameter_m / 2)

    def rise_m(self, x: F64, y: F64) -> F64:
        return np.where(np.hypot(x - self.x_m, y - self.y_m) <= self.diameter_m / 2, self.height_m, 0.0)


@dataclass(frozen=True, slots=True)
class Dome:
    """Upper half of an ellipsoid: a rock, a bush, a crown."""

    kind: str
    x_m: float
    y_m: float
    turn_deg: float
    length_m: float
    width_m: float
    height_m: float

    @property
    def bounds(self) -> Circle:
        return Circle(self.x_m, self.y_m, max(self.length_m, self.width_m) / 2)

    def rise_m(self, x: F64, y: F64) -> F64:
        along, across = _turned(x, y, self.x_m, self.y_m, self.turn_deg)
        q = 1 - (2 * along / self.length_m) ** 2 - (2 * across / self.width_m) ** 2
        return np.asarray(self.height_m * np.sqrt(np.maximum(q, 0.0)))


@dataclass(frozen=True, slots=True)
class Crater:
    """Bowl of a paraboloid with a rim that falls off outside (Pike 1977: 1/5 deep, rim 0.036)."""

    kind: str
    x_m: float
    y_m: float
    diameter_m: float

    @property
    def bounds(self) -> Circle:
        return Circle(self.x_m, self.y_m, RIM_REACH * self.diameter_m / 2)

    def rise_m(self, x: F64, y: F64) -> F64:
        d = self.diameter_m
        q = np.hypot(x - self.x_m, y - self.y_m) / (d / 2)
        bowl = CRATER_DEPTH * d * (q**2 - 1) + CRATER_RIM * d
        rim = CRATER_RIM * d * np.clip((RIM_REACH - q) / (RIM_REACH - 1), 0.0, 1.0)
        return np.where(q < 1, bowl, rim)


@dataclass(frozen=True, slots=True)
class Mound:
    """Bump of a Gaussian profile."""

    kind: str
    x_m: float
    y_m: float
    sigma_m: float
    height_m: float

    @property
    def bounds(self) -> Circle:
        return EVERYWHERE

    def rise_m(self, x: F64, y: F64) -> F64:
        squared = (x - self.x_m) ** 2 + (y - self.y_m) ** 2
        return np.asarray(self.height_m * np.exp(-squared / (2 * self.sigma_m**2)))


@dataclass(frozen=True, slots=True)
class Stairs:
    """Flight of steps that rises along an axis, with a landing on top."""

    kind: str
    x_m: float
    y_m: float
    turn_deg: float
    tread_m: float
    riser_m: float
    steps: int

    @property
    def bounds(self) -> Circle:
        return EVERYWHERE

    def rise_m(self, x: F64, y: F64) -> F64:
        along, _ = _turned(x, y, self.x_m, self.y_m, self.turn_deg)
        return np.asarray(self.riser_m * np.clip(np.floor(along / self.tread_m), 0, self.steps))


@dataclass(frozen=True, slots=True)
class Hills:
    """Egg-box of hills and hollows over the whole scene."""

    kind: str
    length_m: float
    height_m: float

    @property
    def bounds(self) -> Circle:
        return EVERYWHERE

    def rise_m(self, x: F64, y: F64) -> F64:
        k = 2 * np.pi / self.length_m
        return np.asarray(self.height_m * np.sin(k * x) * np.cos(k * y))


@dataclass(frozen=True, slots=True)
class Cable:
    """Straight wire in the air between two points; not part of the surface."""

    kind: str
    from_m: tuple[float, float, float]
    to_m: tuple[float, float, float]
    radius_m: float
