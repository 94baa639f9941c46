"""Layers of surface cells: the probability of each kind, and what follows for landing."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from params import Parameters
from slz.surface.surface_kinds import UNKNOWN_SURFACE, SurfaceHere, SurfaceKind

N_LAYERS = 7
WATER, ROOF, LOW_VEGETATION, CANOPY, RAISED, KIND, SHAPE = range(N_LAYERS)
PROBABLE = {
    SurfaceKind.WATER: WATER,
    SurfaceKind.ROOF: ROOF,
    SurfaceKind.LOW_VEGETATION: LOW_VEGETATION,
    SurfaceKind.CANOPY: CANOPY,
}


@dataclass(frozen=True, slots=True)
class SurfaceLayers:
    """What a box of surface cells is.

    values: (N_LAYERS, rows, cols) float32. WATER to CANOPY: probabilities, 0 where nothing was seen; the rest
    is bare ground, where enough was seen. RAISED: height of a roof over the ground around (m). KIND: the
    likeliest `SurfaceKind`. SHAPE: log odds for water that the level extent of the cell gives, 0 for none.
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
        p = parameters
        out = self.values[WATER] > p.water_suspicion
        for kind, rule in ((SurfaceKind.ROOF, p.roof), (SurfaceKind.LOW_VEGETATION, p.vegetation)):
            if rule == "refuse":
                out |= self.values[KIND] == kind
        return np.asarray(out)

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
