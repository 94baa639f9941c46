"""What the landing executive is told, and what it answers."""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import Enum
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from slz import Report, SelectedPoint

Vector = NDArray[np.float64]


class Phase(Enum):
    """Where a landing stands."""

    IDLE = "idle"
    SURVEY = "survey"
    APPROACH = "approach"
    DESCEND = "descend"
    FINAL = "final"
    LANDED = "landed"
    CLIMB = "climb"
    HOLD = "hold"


FLYING = frozenset({Phase.SURVEY, Phase.APPROACH, Phase.DESCEND, Phase.FINAL, Phase.CLIMB, Phase.HOLD})


class Severity(Enum):
    """Severities of MAVLink's STATUSTEXT that the executive uses."""

    CRITICAL = 2
    WARNING = 4
    NOTICE = 5
    INFO = 6


@dataclass(frozen=True, slots=True)
class Situation:
    """What is known now. Positions and velocities are east, north, up of the map frame.

    guided, landing: the autopilot's mode is the one that obeys us, or its landing mode. on_ground: None when
    the autopilot does not say. lidar_ok: scans arrive and are placed. report: the newest one, or None.
    battery_pct: charge left, None when the autopilot does not say. blocked: something stands in the way that
    the last velocity led. heard: the mode is known to be this one, by a heartbeat a moment ago.
    epoch: another one after each jump of the position estimate.
    """

    now_ns: int
    connected: bool
    armed: bool
    guided: bool
    landing: bool
    mode: str
    on_ground: bool | None
    position_enu_m: Vector | None
    velocity_enu_ms: Vector | None
    height_above_home_m: float
    lidar_ok: bool
    report: Report | None
    selected: SelectedPoint | None
    battery_pct: float | None = None
    blocked: bool = False
    heard: bool = True
    epoch: int = 0


@dataclass(frozen=True, slots=True)
class Orders:
    """What to do now.

    velocity_enu_ms: setpoint, or None to send none. yaw_rad: heading to turn to, or None to keep. mode:
    the kind of mode to ask for. target_enu_m: the landing target to stream. select_enu_m: a point to watch.
    """

    velocity_enu_ms: Vector | None = None
    yaw_rad: float | None = None
    mode: Literal["guided", "land"] | None = None
    target_enu_m: Vector | None = None
    select_enu_m: Vector | None = None
    texts: tuple[tuple[Severity, str], ...] = ()


@dataclass(frozen=True, slots=True)
class Reply:
    """Answer to an operator: accepted or not, and why."""

    accepted: bool
    reason: str


@dataclass(slots=True)
class Tally:
    """What happened so far, for the summary."""

    aborts: int = 0
    abort_reasons: list[str] = field(default_factory=list)
    hands_off: int = 0
    zone_id: int | None = None
    chosen_enu_m: Vector | None = None


@dataclass(frozen=True, slots=True)
class Wish:
    """What the operator asked for: a point, or None for the best zone; urgent: the one reached soonest."""

    enu_m: Vector | None = None
    zone_id: int | None = None
    urgent: bool = False
