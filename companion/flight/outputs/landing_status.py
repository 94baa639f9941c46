"""Landing status for ground stations: NAMED_VALUE_FLOAT, once a second."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

from companion.flight.link.statustext import named_value

PHASES = ("idle", "survey", "approach", "descend", "final", "landed", "climb", "hold", "failsafe")
POINTS = ("none", "safe", "unsafe", "unknown")


@dataclass(frozen=True, slots=True)
class Status:
    """Values to send; NaN is not sent.

    phase, point: one of `PHASES`, of `POINTS`. zones: their number. best_zone: ID of the best ranked zone.
    certainty: probability that the selected point is safe, else that of the best zone. height_m: over the
    selected point. latency_ms: median age of the newest window's returns at its report. dropped: windows,
    and messages that no channel accepted. sync_ms: residual of TIMESYNC.
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
    """Return a message for each known value; -1 stands for a phase or point state that is not listed."""
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
