"""The state of the landing as numbers for ground stations: NAMED_VALUE_FLOAT, once a second."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

from companion.flight.link.statustext import named_value

PHASES = ("idle", "survey", "approach", "descend", "final", "landed", "climb", "hold", "failsafe")
POINTS = ("none", "safe", "unsafe", "unknown")


@dataclass(frozen=True, slots=True)
class Status:
    """What is told; NaN is not told.

    phase, point: one of `PHASES`, of `POINTS`. zones: how many there are. best_zone: ID of the best ranked.
    certainty: probability that the selected point is safe, else that of the best zone. height_m: over the
    selected point. latency_ms: of the last window from its last scan to the report. dropped: windows, and
    messages that no channel took. sync_ms: residual of TIMESYNC.
    """

    phase: str
    zones: int
    best_zone: float
    point: str
    certainty: float
    height_m: float
    latency_ms: float
    dropped: int
    sync_ms: float


def status_messages(status: Status, boot_ms: int) -> list[Any]:
    """Return a message for each value that is known; what is no phase or state of a point is told as -1."""
    values = {
        "SLZ_PHASE": _number(status.phase, PHASES),
        "SLZ_ZONES": status.zones,
        "SLZ_BEST": status.best_zone,
        "SLZ_POINT": _number(status.point, POINTS),
        "SLZ_SURE": status.certainty,
        "SLZ_HEIGHT": status.height_m,
        "SLZ_LATE": status.latency_ms,
        "SLZ_DROPS": status.dropped,
        "SLZ_SYNC": status.sync_ms,
    }
    return [
        named_value(name, float(value), boot_ms) for name, value in values.items() if math.isfinite(value)
    ]


def _number(name: str, names: tuple[str, ...]) -> int:
    return names.index(name) if name in names else -1
