"""Truth of each return of a pulse: the solid, mover or layer that it comes from."""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

from sitl.sensors.layer_echoes import PULSE_M, BeamEchoes, Reported
from sitl.sensors.optics import Echoes
from sitl.world.hits import DUST, GHOST, NOTHING

I64 = NDArray[np.int64]


@dataclass(frozen=True, slots=True)
class Hits:
    """What the three ranges of `Echoes` come from, (n,) codes of ``hits`` each."""

    strongest: I64
    behind: I64
    other: I64

    @classmethod
    def of_one(cls, hit: I64, seen: NDArray[np.bool_]) -> Hits:
        """Return the hits of pulses with one echo or none."""
        one = np.where(seen, hit, NOTHING)
        return cls(one, one, one)

    def __getitem__(self, cut: slice) -> Hits:
        return Hits(*(getattr(self, f.name)[cut] for f in fields(self)))

    def followed_by(self, later: Hits) -> Hits:
        """Return these hits followed by later ones."""
        return Hits(*(np.concatenate([getattr(self, f.name), getattr(later, f.name)]) for f in fields(self)))

    def with_several(self, at: I64, found: Reported, echoes: BeamEchoes, labels: I64) -> Hits:
        """Return the hits with those of pulses of several echoes, by what is reported and all labels."""
        written = []
        with np.errstate(invalid="ignore"):
            for before, column, range_m in (
                (self.strongest, found.strongest, found.strongest_m),
                (self.behind, found.last, found.last_m),
                (self.other, found.other, found.other_m),
            ):
                # Of echoes that overlap, the brightest names the return.
                ahead = echoes.range_m - np.take_along_axis(echoes.range_m, column[:, np.newaxis], 1)
                bright = np.where(np.abs(ahead) <= PULSE_M, echoes.bright, -1.0).argmax(axis=1)
                named = np.take_along_axis(labels, bright[:, np.newaxis], 1)[:, 0]
                own = before.copy()
                own[at] = np.where(range_m > 0.0, named, NOTHING)
                written.append(own)
        return Hits(*written)

    def falsified(self, echoes: Echoes) -> Hits:
        """Return the hits with the false returns among them."""
        if not (echoes.ghost.any() or echoes.dust.any()):
            return self
        strongest, behind, other = (
            np.where(echoes.ghost, GHOST, hit) for hit in (self.strongest, self.behind, self.other)
        )
        return Hits(np.where(echoes.dust, DUST, strongest), behind, np.where(echoes.dust, DUST, other))
