"""World primitives: materials, a height field, and four kinds of solid.

Every solid has its bounds, its row in the ray caster's table, and its description in ``scene.json``.
Positions are ENU metres, yaw is radians counter-clockwise from east.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

BOX, CYLINDER, ELLIPSOID, WIRE = 0, 1, 2, 3
ROW_LENGTH = 8

Bounds = tuple[float, float, float, float, float, float]
"""(x_min, y_min, z_min, x_max, y_max, z_max), metres."""


class Kind(IntEnum):
    """Material of a surface, as returned by the ray caster."""

    NOTHING = 0
    GRASS = 1
    ASPHALT = 2
    PAVING = 3
    CONCRETE = 4
    ROOF = 5
    FOLIAGE = 6
    WOOD = 7
    METAL = 8
    CAR = 9
    ROCK = 10
    SOIL = 11
    WATER = 12
    SAND = 13
    SNOW = 14
    WET_ASPHALT = 15
    """Asphalt under a film of water."""
    PUDDLE = 16
    """Standing water of a few centimetres."""
    MAIZE = 17
    WHEAT = 18
    REED = 19
    MEADOW = 20
    """Grass of a hand's height."""
    GRAVEL = 21
    BITUMEN = 22


# Diffuse reflectance near 905 nm: typical textbook values; green plants are bright in the near infrared.
_REFLECTANCE = {
    Kind.NOTHING: 0.0,
    Kind.GRASS: 0.50,
    Kind.ASPHALT: 0.13,
    Kind.PAVING: 0.30,
    Kind.CONCRETE: 0.38,
    Kind.ROOF: 0.22,
    Kind.FOLIAGE: 0.45,
    Kind.WOOD: 0.35,
    Kind.METAL: 0.45,
    Kind.CAR: 0.40,
    Kind.ROCK: 0.25,
    Kind.SOIL: 0.27,
    Kind.WATER: 0.0,
    Kind.SAND: 0.40,
    Kind.SNOW: 0.80,
    # Water in the pores traps light: wet asphalt has a third of its reflectance when dry (J. Lekner and M. C.
    # Dorf, Applied Optics 27, 1988).
    Kind.WET_ASPHALT: 0.05,
    Kind.PUDDLE: 0.0,
    Kind.MAIZE: 0.45,
    Kind.WHEAT: 0.40,
    Kind.REED: 0.40,
    Kind.MEADOW: 0.50,
    Kind.GRAVEL: 0.30,
    Kind.BITUMEN: 0.08,
}
REFLECTANCE: NDArray[np.float64] = np.array([_REFLECTANCE[kind] for kind in Kind])
REFLECTANCE.setflags(write=False)


@dataclass(frozen=True, slots=True)
class Ground:
    """Bilinear height field: posts on a square grid, one material for each square between four posts.

    Parameters
    ----------
    x0_m, y0_m
        Position of post [0, 0].
    post_m
        Distance between posts.
    z_m
        (ny, nx) f64 heights of the posts, row = y.
    kind
        (ny - 1, nx - 1) u8 material of the squares.
    """

    x0_m: float
    y0_m: float
    post_m: float
    z_m: NDArray[np.float64]
    kind: NDArray[np.uint8]

    def __post_init__(self) -> None:
        rows, columns = self.z_m.shape
        if rows < 2 or columns < 2 or self.kind.shape != (rows - 1, columns - 1):
            raise ValueError(
                f"ground: {rows} x {columns} posts need at least 2 x 2 and kind of shape "
                f"{(rows - 1, columns - 1)}, got {self.kind.shape}"
            )
        if self.post_m <= 0.0 or not np.isfinite(self.z_m).all():
            raise ValueError("ground: post_m must be positive and every height finite")

    @property
    def extent_m(self) -> tuple[float, float, float, float]:
        """(x_min, y_min, x_max, y_max) covered by squares."""
        rows, columns = self.z_m.shape
        return (
            self.x0_m,
            self.y0_m,
            self.x0_m + (columns - 1) * self.post_m,
            self.y0_m + (rows - 1) * self.post_m,
        )


@dataclass(frozen=True, slots=True)
class Box:
    """Upright box rotated by yaw about z; ``length_m`` is along the yaw direction, ``z_m`` is its foot."""

    x_m: float
    y_m: float
    z_m: float
    length_m: float
    width_m: float
    height_m: float
    yaw_rad: float = 0.0
    kind: Kind = Kind.CONCRETE
    name: str = "box"

    def bounds(self) -> Bounds:
        c, s = abs(math.cos(self.yaw_rad)), abs(math.sin(self.yaw_rad))
        reach_x = (self.length_m * c + self.width_m * s) / 2
        reach_y = (self.length_m * s + self.width_m * c) / 2
        top = self.z_m + self.height_m
        return (
            self.x_m - reach_x,
            self.y_m - reach_y,
            self.z_m,
            self.x_m + reach_x,
            self.y_m + reach_y,
            top,
        )

    def row(self) -> tuple[int, tuple[float, ...]]:
        cosine, sine = math.cos(self.yaw_rad), math.sin(self.yaw_rad)
        half = (self.length_m / 2, self.width_m / 2)
        return BOX, (self.x_m, self.y_m, self.z_m, self.z_m + self.height_m, *half, cosine, sine)

    def describe(self) -> dict[str, object]:
        size = [self.length_m, self.width_m, self.height_m]
        return {"shape": "box", "position_enu_m": [self.x_m, self.y_m, self.z_m], "size_m": size} | {
            "yaw_rad": self.yaw_rad
        }


@dataclass(frozen=True, slots=True)
class Cylinder:
    """Vertical cylinder with flat ends: posts, trunks, masts, tanks."""

    x_m: float
    y_m: float
    z_m: float
    radius_m: float
    height_m: float
    kind: Kind = Kind.METAL
    name: str = "cylinder"

    def bounds(self) -> Bounds:
        x, y, r = self.x_m, self.y_m, self.radius_m
        return (x - r, y - r, self.z_m, x + r, y + r, self.z_m + self.height_m)

    def row(self) -> tuple[int, tuple[float, ...]]:
        return CYLINDER, (
            self.x_m,
            self.y_m,
            self.z_m,
            self.z_m + self.height_m,
            self.radius_m,
            0.0,
            0.0,
            0.0,
        )

    def describe(self) -> dict[str, object]:
        size = [2 * self.radius_m, 2 * self.radius_m, self.height_m]
        return {"shape": "cylinder", "position_enu_m": [self.x_m, self.y_m, self.z_m], "size_m": size}


@dataclass(frozen=True, slots=True)
class Ellipsoid:
    """Ellipsoid with axes along x, y, z about its centre: crowns, bushes, boulders."""

    x_m: float
    y_m: float
    z_m: float
    radius_x_m: float
    radius_y_m: float
    radius_z_m: float
    kind: Kind = Kind.FOLIAGE
    name: str = "ellipsoid"

    def bounds(self) -> Bounds:
        x, y, z = self.x_m, self.y_m, self.z_m
        a, b, c = self.radius_x_m, self.radius_y_m, self.radius_z_m
        return (x - a, y - b, z - c, x + a, y + b, z + c)

    def row(self) -> tuple[int, tuple[float, ...]]:
        radii = (self.radius_x_m, self.radius_y_m, self.radius_z_m)
        return ELLIPSOID, (self.x_m, self.y_m, self.z_m, *radii, 0.0, 0.0)

    def describe(self) -> dict[str, object]:
        size = [2 * self.radius_x_m, 2 * self.radius_y_m, 2 * self.radius_z_m]
        return {"shape": "ellipsoid", "position_enu_m": [self.x_m, self.y_m, self.z_m], "size_m": size}


@dataclass(frozen=True, slots=True)
class Wire:
    """Straight tube between two points, without end caps: cables, cross-bars, fence rails."""

    start_enu_m: tuple[float, float, float]
    end_enu_m: tuple[float, float, float]
    radius_m: float = 0.01
    kind: Kind = Kind.METAL
    name: str = "wire"

    def __post_init__(self) -> None:
        if math.dist(self.start_enu_m[:2], self.end_enu_m[:2]) < 1e-6:
            raise ValueError(f"wire {self.name!r}: vertical; use a Cylinder for an upright tube")

    def bounds(self) -> Bounds:
        low = [min(a, b) - self.radius_m for a, b in zip(self.start_enu_m, self.end_enu_m, strict=True)]
        high = [max(a, b) + self.radius_m for a, b in zip(self.start_enu_m, self.end_enu_m, strict=True)]
        return (low[0], low[1], low[2], high[0], high[1], high[2])

    def row(self) -> tuple[int, tuple[float, ...]]:
        return WIRE, (*self.start_enu_m, *self.end_enu_m, self.radius_m, 0.0)

    def describe(self) -> dict[str, object]:
        ends = {"start_enu_m": list(self.start_enu_m), "end_enu_m": list(self.end_enu_m)}
        return {"shape": "wire", **ends, "diameter_m": 2 * self.radius_m}


Solid = Box | Cylinder | Ellipsoid | Wire
