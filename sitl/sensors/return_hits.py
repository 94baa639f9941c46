"""Truth of each return of a pulse: the solid, mover or layer that it comes from."""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

from sitl.sensors.optics import Echoes
from sitl.world.hits import DUST, GHOST

I64 = NDArray[np.int64]


@dataclass(frozen=True, slots=True)
class Hits:
    """What the three ranges of `Echoes` come from, (n,) codes of ``hits`` each."""

    strongest: I64
    behind: I64
    other: I64

    def __getitem__(self, cut: slice) -> Hits:
        return Hits(*(getattr(self, f.name)[cut] for f in fields(self)))

    def followed_by(self, later: Hits) -> Hits:
        """Return these hits followed by later ones."""
        return Hits(*(np.concatenate([getattr(self, f.name), getattr(later, f.name)]) for f in fields(self)))

    def falsified(self, echoes: Echoes) -> Hits:
        """Return the hits with the false returns among them."""
        if not (echoes.ghost.any() or echoes.dust.any()):
            return self
        strongest, behind, other = (
            np.where(echoes.ghost, GHOST, hit) for hit in (self.strongest, self.behind, self.other)
        )
        return Hits(np.where(echoes.dust, DUST, strongest), behind, np.where(echoes.dust, DUST, other))
