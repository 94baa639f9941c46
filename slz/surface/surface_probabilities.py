"""Layers of surface cells: the probability of each kind, and what follows for landing."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from params import Parameters
from slz.kernels.surface.surface_record import CANOPY, KIND, LOW_VEGETATION, RAISED, ROOF, WATER
from slz.surface.surface_kinds import UNKNOWN_SURFACE, SurfaceHere, SurfaceKind

PROBABLE = {
    SurfaceKind.WATER: WATER,
    SurfaceKind.ROOF: ROOF,
    SurfaceKind.LOW_VEGETATION: LOW_VEGETATION,
    SurfaceKind.CANOPY: CANOPY,
}


def refused_kinds(parameters: Parameters) -> NDArray[np.bool_]:
    """Return whether the profile refuses to land on each `SurfaceKind`, whatever its shape."""
    rules = {SurfaceKind.ROOF: parameters.roof, SurfaceKind.LOW_VEGETATION: parameters.vegetation}
    return np.array([rules.get(kind) == "refuse" for kind in SurfaceKind])


@dataclass(frozen=True, slots=True)
class SurfaceLayers:
    """What a box of surface cells is.

    values: (N_LAYERS, rows, cols) float32 of `slz.kernels.surface.surface_record`.
    """

    values: NDArray[np.float32]

    @property
    def water(self) -> NDArray[np.float32]:
        """Probability of water."""
        return np.asarray(self.values[WATER])

    @property
    def kind(self) -> NDArray[np.uint8]:
        """Likeliest kind of each cell."""
        return np.asarray(self.values[KIND].astype(np.uint8))

    def refused(self, parameters: Parameters) -> NDArray[np.bool_]:
        """Return the cells on which no vehicle may land: water may be there, or what the profile refuses."""
        return np.asarray((self.water > parameters.water_suspicion) | refused_kinds(parameters)[self.kind])

    def here(self) -> SurfaceHere:
        """Return what the box is as a whole: its most frequent kind, and its worst suspicion of water."""
        kinds = self.kind.ravel()
        known = kinds[kinds != SurfaceKind.UNKNOWN]
        if not len(known):
            water = float(self.water.max(initial=0.0))
            return SurfaceHere(water=water) if water > 0 else UNKNOWN_SURFACE
        kind = SurfaceKind(int(np.bincount(known).argmax()))
        own = self.kind == kind
        at = PROBABLE.get(kind)
        sure = self.values[at][own] if at is not None else 1 - self.values[:RAISED].sum(axis=0)[own]
        raised_m = float(np.median(self.values[RAISED][own])) if kind is SurfaceKind.ROOF else 0.0
        return SurfaceHere(kind, float(sure.mean()), float(self.water.max()), raised_m)
