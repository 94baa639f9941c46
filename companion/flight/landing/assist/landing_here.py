"""Nearest safe place of a landing at this moment, in words and numbers for the pilot."""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import StrEnum
from typing import Self

from companion.flight.landing.situation import Vector

COMPASS = ("N", "NE", "E", "SE", "S", "SW", "W", "NW")


class Here(StrEnum):
    """Outcomes of a landing at this moment: safe below, a place near, none, or no map to say."""

    SAFE = "safe"
    NEAR = "near"
    NONE = "none within reach"
    UNKNOWN = "no map"


@dataclass(frozen=True, slots=True)
class LandingHere:
    """Landing here now. away_m, bearing_deg: of the nearest place or zone that is safe, NaN without one."""

    here: Here = Here.NONE
    away_m: float = math.nan
    bearing_deg: float = math.nan

    @classmethod
    def towards(cls, position_enu_m: Vector, enu_m: Vector) -> Self:
        """Return that nothing is within reach, and where a zone is."""
        east, north = (enu_m - position_enu_m)[:2].tolist()
        return cls(Here.NONE, math.hypot(east, north), math.degrees(math.atan2(east, north)) % 360)

    @property
    def number_m(self) -> float:
        """Distance: 0 where it is safe below, -1 where nothing is within reach, NaN without a map."""
        return {Here.SAFE: 0.0, Here.NEAR: self.away_m, Here.NONE: -1.0, Here.UNKNOWN: math.nan}[self.here]

    @property
    def way(self) -> str:
        """Distance and direction in words, "" without a place."""
        where = COMPASS[0 if math.isnan(self.bearing_deg) else round(self.bearing_deg / 45) % 8]
        return "" if math.isnan(self.away_m) else f"{self.away_m:.0f} m {where}"

    @property
    def text(self) -> str:
        """Text for the pilot."""
        match self.here:
            case Here.NEAR:
                return f"{self.way}, free way"
            case Here.NONE if self.way:
                return f"{self.here.value}, nearest {self.way}"
            case _:
                return self.here.value
