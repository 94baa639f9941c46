"""Layers over the bare ground that light enters: standing water, plants and snow.

Heights are ENU metres. A layer is known for each square of the ground (between four posts).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sitl.world.primitives import Ground, Kind
from sitl.world.tables import LayerTable

F64 = NDArray[np.float64]
U8 = NDArray[np.uint8]
CLEARANCE_M = 0.01


@dataclass(frozen=True, slots=True)
class Plants:
    """Stand of plants, or a cover of snow: a turbid medium above the ground (Beer-Lambert).

    A beam meets a leaf with probability ``extinction_per_m`` ds on its way ds through the stand. For leaves
    of area density u (m2/m3), extinction = G u, with G = 0.5 for leaves of all inclinations (J. Ross, The
    Radiation Regime and Architecture of Plant Stands, 1981), times a clumping factor below one where leaves
    overlap (T. Nilson, Agricultural Meteorology 8, 1971).

    Attributes
    ----------
    kind
        Kind of the top.
    height_m
        Mean height of the stand above the ground.
    extinction_per_m
        Mean extinction along a path.
    uneven
        Largest deviation of the height from its mean, as a share.
    row_m
        Distance of the rows, which run north; 0 for plants without rows.
    row_contrast
        Extinction is 1 + contrast times the mean in a row, and 1 - contrast between two.
    """

    kind: Kind
    height_m: float
    extinction_per_m: float
    uneven: float = 0.2
    row_m: float = 0.0
    row_contrast: float = 0.0

    @property
    def tallest_m(self) -> float:
        return self.height_m * (1.0 + self.uneven)

    def row(self) -> tuple[float, ...]:
        """Return the plants' row of the ray caster's table."""
        return (
            float(self.kind),
            self.height_m,
            self.extinction_per_m,
            self.uneven,
            self.row_m,
            self.row_contrast,
        )


# Leaf area indices (m2/m2) over the height, G = 0.5 (0.35 for the upright leaves of reed), clumping 0.8:
# maize 4 over 2 m, wheat 4 over 0.7 m, reed 4 over 1.5 m, meadow 2.5 over 0.15 m.
MAIZE = Plants(Kind.MAIZE, 2.0, 0.8, 0.15, 0.75, 0.7)
WHEAT = Plants(Kind.WHEAT, 0.7, 2.3, 0.15)
REED = Plants(Kind.REED, 1.5, 0.75, 0.25)
MEADOW = Plants(Kind.MEADOW, 0.15, 6.7, 0.2)
# Snow returns light near 900 nm from a depth of 1 to 2 cm (S. G. Warren, Reviews of Geophysics 20, 1982).
SNOW = Plants(Kind.SNOW, 0.25, 60.0, 0.3)


@dataclass(frozen=True, slots=True)
class SurfaceLayers:
    """Layers of a ground's squares.

    Attributes
    ----------
    water_z_m
        (ny - 1, nx - 1) f64 level of standing water, NaN where there is none. Water is where the level is
        above the ground, so the shore is exact within a square.
    plant
        (ny - 1, nx - 1) u8: 0 for none, k for ``plants[k - 1]``.
    plants
        Stands of plants that occur.
    """

    water_z_m: F64
    plant: U8
    plants: tuple[Plants, ...] = ()

    def __post_init__(self) -> None:
        if self.water_z_m.shape != self.plant.shape or int(self.plant.max(initial=0)) > len(self.plants):
            raise ValueError("surface layers: water and plant need one shape, and plants for every number")

    def table(self, ground: Ground) -> LayerTable:
        """Return the ray caster's table.

        Raises
        ------
        ValueError
            If the layers are not those of the ground's squares.
        """
        if self.plant.shape != ground.kind.shape:
            raise ValueError(f"surface layers: shape {self.plant.shape}, the ground has {ground.kind.shape}")
        rows = np.array([p.row() for p in self.plants], dtype=np.float64).reshape(-1, 6)
        tops = np.array([0.0, *(p.tallest_m for p in self.plants)])[self.plant]
        z = ground.z_m
        corners = np.maximum(np.maximum(z[1:, 1:], z[1:, :-1]), np.maximum(z[:-1, 1:], z[:-1, :-1]))
        highest = np.where(self.plant > 0, corners + tops, -math.inf)
        top = max(float(highest.max()), float(np.nanmax(self.water_z_m, initial=-math.inf)))
        return (
            np.ascontiguousarray(self.water_z_m, dtype=np.float64),
            np.ascontiguousarray(self.plant, dtype=np.uint8),
            rows,
            np.array([top + CLEARANCE_M]),
        )
