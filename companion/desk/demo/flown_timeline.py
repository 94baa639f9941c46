"""Timeline of a demonstration flight: places and phases over time, and the texts to the pilot."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

from companion.flight.app import Companion


@dataclass(frozen=True, slots=True)
class Moment:
    """State at a time: simulated seconds since the start, phase, height above home (m), place (WGS-84)."""

    at_s: float
    phase: str
    height_m: float | None
    lla: tuple[float, float, float] | None


@dataclass(frozen=True, slots=True)
class Said:
    """Text to the pilot: simulated seconds since the start, MAV_SEVERITY, text."""

    at_s: float
    severity: int
    text: str


@dataclass(slots=True)
class Timeline:
    """Moments and texts in the order of time. Places are independent of the map frame, which may change."""

    moments: list[Moment] = field(default_factory=list)
    texts: list[Said] = field(default_factory=list)

    def note(self, at_s: float, companion: Companion) -> None:
        """Add the state of now."""
        now, frame = companion.deciding.situations.situation(), companion.sensing.history.frame
        place = None
        if now.position_enu_m is not None and frame is not None:
            lat, lon, alt = (float(v) for v in frame.lla(now.position_enu_m))
            place = lat, lon, alt
        height_m = now.height_above_home_m if math.isfinite(now.height_above_home_m) else None
        self.moments.append(Moment(at_s, companion.executive.phase.value, height_m, place))
