"""Scene: a world, the vehicle's start, and named regions for evaluation."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

from sitl.world.world import World

Polygon = tuple[tuple[float, float], ...]
"""Corners (x, y) in ENU metres, counter-clockwise, not closed."""


@dataclass(frozen=True, slots=True)
class Scene:
    """World with a name, a start and named regions.

    ``home_enu`` is (x, y, heading): heading in radians clockwise from north, as in autopilots (the yaw of
    objects in the world is counter-clockwise from east). ``extent_m`` is (x_min, y_min, x_max, y_max).
    ``dust_below_m``: height above ground below which the rotors raise dust that no LiDAR can see through.
    ``wash``: whether the rotors move the plants below them.
    """

    name: str
    seed: int
    world: World
    home_enu: tuple[float, float, float]
    description: str
    regions: Mapping[str, Polygon]
    dust_below_m: float = 0.0
    wash: bool = False

    @property
    def extent_m(self) -> tuple[float, float, float, float]:
        return self.world.extent_m


def rectangle(x0: float, y0: float, x1: float, y1: float) -> Polygon:
    """Return the corners of a rectangle."""
    return ((x0, y0), (x1, y0), (x1, y1), (x0, y1))


def ellipse(x: float, y: float, radius_x: float, radius_y: float, corners: int = 24) -> Polygon:
    """Return a polygon inscribed in an ellipse."""
    turns = [2.0 * math.pi * k / corners for k in range(corners)]
    return tuple((x + radius_x * math.cos(a), y + radius_y * math.sin(a)) for a in turns)
