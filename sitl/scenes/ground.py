"""Terrain of a scene: hills, random relief and materials on a grid of posts."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from sitl.world.plant_motion import Sway
from sitl.world.primitives import Ground, Kind, Solid
from sitl.world.surface_layers import Plants, SurfaceLayers
from sitl.world.water_waves import WaterState
from sitl.world.world import World

F64 = NDArray[np.float64]
Mask = NDArray[np.bool_]

MICRO_RELIEF_M: dict[Kind, float] = {
    Kind.ASPHALT: 0.003,
    Kind.PAVING: 0.003,
    Kind.GRASS: 0.010,
    Kind.SOIL: 0.013,
    Kind.ROCK: 0.06,
    Kind.SAND: 0.010,
    Kind.SNOW: 0.010,
    Kind.WET_ASPHALT: 0.003,
    Kind.GRAVEL: 0.015,
}
"""Standard deviation of single posts; peaks are about three times as high."""
LAWN_RELIEF_M = 0.004


class Terrain:
    """Square grid of posts with operations that add hills, levels and materials.

    Parameters
    ----------
    half_m
        The ground covers -half_m .. half_m in x and y.
    post_m
        Distance between posts.
    rng
        Source of all relief.
    """

    def __init__(self, half_m: float, post_m: float, rng: np.random.Generator) -> None:
        count = round(2 * half_m / post_m) + 1
        axis = (np.arange(count) - (count - 1) / 2) * post_m
        self.post_m, self._rng = post_m, rng
        self.x, self.y = np.meshgrid(axis, axis)
        self.z: F64 = np.zeros((count, count))
        self.relief_m: F64 = np.full((count, count), MICRO_RELIEF_M[Kind.GRASS])
        self.kind = np.full((count, count), Kind.GRASS, dtype=np.uint8)
        self._water_z: F64 = np.full((count, count), np.nan)
        self._plant = np.zeros((count, count), np.uint8)
        self._plants: list[Plants] = []

    def rectangle(self, x0: float, y0: float, x1: float, y1: float) -> Mask:
        """Return the mask of posts in a rectangle."""
        mask: Mask = (self.x >= x0) & (self.x <= x1) & (self.y >= y0) & (self.y <= y1)
        return mask

    def ellipse(self, x: float, y: float, radius_x: float, radius_y: float) -> Mask:
        """Return the mask of posts in an ellipse."""
        mask: Mask = ((self.x - x) / radius_x) ** 2 + ((self.y - y) / radius_y) ** 2 <= 1.0
        return mask

    def hill(self, x: float, y: float, height_m: float, sigma_m: float) -> None:
        """Raise a bell-shaped hill; its steepest slope, 0.61 height / sigma, is at sigma_m from its top."""
        distance2 = (self.x - x) ** 2 + (self.y - y) ** 2
        self.z += height_m * np.exp(-distance2 / (2.0 * sigma_m**2))

    def swell(self, std_m: float, length_m: float) -> None:
        """Add random relief of a standard deviation and a wavelength."""
        noise = self._rng.standard_normal(self.z.shape)
        smooth = ndimage.gaussian_filter(noise, length_m / self.post_m / 4.0, mode="reflect")
        self.z += std_m * smooth / smooth.std()

    def cover(self, where: Mask, kind: Kind, relief_m: float | None = None) -> None:
        """Set the material of a part of the ground, with its micro relief."""
        self.kind[where] = kind
        self.relief_m[where] = MICRO_RELIEF_M[kind] if relief_m is None else relief_m

    def level(self, where: Mask, height_m: float, blend_m: float) -> None:
        """Flatten a part of the ground at a height, with a smooth shoulder blend_m wide around it."""
        distance = ndimage.distance_transform_edt(~where) * self.post_m
        share = np.clip(1.0 - distance / blend_m, 0.0, 1.0)
        share = share * share * (3.0 - 2.0 * share)
        self.z += share * (height_m - self.z)

    def flood(self, where: Mask, height_m: float, bank_m: float) -> None:
        """Add still water at a height."""
        self.level(where, height_m, bank_m)
        self.cover(where, Kind.WATER, 0.0)

    def stand_water(self, where: Mask, level_m: float | NDArray[np.float64]) -> None:
        """Let water stand at a level wherever the ground of a part is lower; its bottom is the ground.

        level_m: one for all, or of every post; that of a river falls.
        """
        self._water_z[where] = np.broadcast_to(level_m, self.z.shape)[where]

    def grow(self, where: Mask, plants: Plants) -> None:
        """Cover a part of the ground with plants or snow."""
        if plants not in self._plants:
            self._plants.append(plants)
        self._plant[where] = self._plants.index(plants) + 1

    def at(self, x: float, y: float) -> float:
        """Return the height of the post nearest to (x, y), without micro relief."""
        i = round((x - self.x[0, 0]) / self.post_m)
        j = round((y - self.y[0, 0]) / self.post_m)
        return float(self.z[j, i])

    def ground(self) -> Ground:
        """Return the finished ground, with its micro relief."""
        z = self.z + self.relief_m * self._rng.standard_normal(self.z.shape)
        water = self.kind == Kind.WATER
        # A square is water only if all its corners are, so that its surface is level.
        wet = water[:-1, :-1] & water[1:, :-1] & water[:-1, 1:] & water[1:, 1:]
        square = np.where(self.kind[:-1, :-1] == Kind.WATER, np.uint8(Kind.SOIL), self.kind[:-1, :-1])
        square[wet] = Kind.WATER
        return Ground(float(self.x[0, 0]), float(self.y[0, 0]), self.post_m, z, square)

    def world(
        self,
        solids: Sequence[Solid] = (),
        cell_m: float = 4.0,
        water: WaterState | None = None,
        sways: Mapping[int, Sway] = MappingProxyType({}),
    ) -> World:
        """Return the world of the finished ground with its water and plants."""
        ground = self.ground()
        if not self._plants and np.isnan(self._water_z).all():
            return World(ground, solids, cell_m, water=water, sways=sways)
        z, level = ground.z_m, self._water_z
        corners = np.stack([level[:-1, :-1], level[1:, :-1], level[:-1, 1:], level[1:, 1:]])
        lowest = np.min([z[:-1, :-1], z[1:, :-1], z[:-1, 1:], z[1:, 1:]], axis=0)
        highest = np.where(np.isnan(corners), -np.inf, corners).max(axis=0)
        layers = SurfaceLayers(
            np.where(highest > lowest, highest, np.nan), self._plant[:-1, :-1].copy(), tuple(self._plants)
        )
        return World(ground, solids, cell_m, layers=layers, water=water, sways=sways)
