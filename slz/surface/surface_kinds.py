"""Kinds of surface, and the words for them."""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import IntEnum


class SurfaceKind(IntEnum):
    """Material of the ground as classified from its returns."""

    UNKNOWN = 0
    BARE = 1
    WATER = 2
    ROOF = 3
    LOW_VEGETATION = 4
    CANOPY = 5

    @property
    def word(self) -> str:
        """The kind in words."""
        return WORDS[self]


WORDS = {
    SurfaceKind.UNKNOWN: "unknown",
    SurfaceKind.BARE: "bare ground",
    SurfaceKind.WATER: "water",
    SurfaceKind.ROOF: "roof",
    SurfaceKind.LOW_VEGETATION: "low vegetation",
    SurfaceKind.CANOPY: "canopy",
}


@dataclass(frozen=True, slots=True)
class SurfaceHere:
    """Surface at a place.

    probability: of the kind. water: highest probability of water there. raised_m: of a roof, over the ground
    around it.
    """

    kind: SurfaceKind = SurfaceKind.UNKNOWN
    probability: float = math.nan
    water: float = 0.0
    raised_m: float = 0.0

    @property
    def text(self) -> str:
        """The kind in words, a roof with its height."""
        raised = f", {self.raised_m:.0f} m up" if self.kind is SurfaceKind.ROOF and self.raised_m > 0 else ""
        return self.kind.word + raised

    def must_be_confirmed(self, roof: str, vegetation: str) -> bool:
        """Return whether a landing here needs the operator's confirmation by the profile's rules."""
        rule = {SurfaceKind.ROOF: roof, SurfaceKind.LOW_VEGETATION: vegetation}.get(self.kind, "allow")
        return rule != "allow"


UNKNOWN_SURFACE = SurfaceHere()
