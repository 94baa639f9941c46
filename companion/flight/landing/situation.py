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
    FAILSAFE = "failsafe"  # the autopilot flies by itself, or its estimate is lost: nothing is commanded


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
    the autopilot does not say. lidar_ok: scans arrive and are placed; blind: what is wrong if they are not.
    report: the newest one, or None. battery_pct: charge left, None when the autopilot does not say. blocked:
    something stands in the way that the last velocity led. heard: the mode is known to be this one, by a
    heartbeat a moment ago. epoch: another one after each jump of the position estimate.

    failsafe: the autopilot says that it is in one. breached: outside its fence. estimate_lost: what its
    estimator had and has lost. gps_lost: the receiver lost its fix; the estimate drifts. cause: what the
    failsafe is about. target_lost_ns: when the autopilot last said that it lost the landing target.
    sticks_us: the pilot's roll and pitch stick, None where none are seen. switched: the pilot's transmitter
    moved a switch within the last seconds. fit: the autopilot is known to be set up for a landing.
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
    blind: str = "LiDAR lost"
    failsafe: bool = False
    breached: bool = False
    estimate_lost: str = ""
    gps_lost: bool = False
    cause: str = ""
    target_lost_ns: int | None = None
    sticks_us: tuple[int, int] | None = None
    switched: bool = False
    fit: bool = True


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
    """What happened so far, for the summary.

    failsafes: why it stood back from each. off_point_m: distance to the point at touchdown, None before.
    """

    aborts: int = 0
    abort_reasons: list[str] = field(default_factory=list)
    hands_off: int = 0
    failsafes: list[str] = field(default_factory=list)
    off_point_m: float | None = None
    zone_id: int | None = None
    chosen_enu_m: Vector | None = None


@dataclass(frozen=True, slots=True)
class Wish:
    """What the operator asked for: a point, or None for the best zone; urgent: the one reached soonest."""

    enu_m: Vector | None = None
    zone_id: int | None = None
    urgent: bool = False
