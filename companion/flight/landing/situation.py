"""Inputs and outputs of the landing executive."""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import Enum
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from companion.flight.geometry.geofence import NO_FENCE, Geofence
from companion.flight.geometry.wind import Wind
from slz import Intrusion, MovingObject, Report, SelectedPoint, SurfaceHere, SurfaceKind
from slz.surface.surface_kinds import UNKNOWN_SURFACE

Vector = NDArray[np.float64]
STOPPED: Vector = np.zeros(3)  # setpoint of a vehicle that holds its position


class Phase(Enum):
    """Phases of a landing."""

    IDLE = "idle"
    SURVEY = "survey"
    APPROACH = "approach"
    DESCEND = "descend"
    FINAL = "final"
    LANDED = "landed"
    CLIMB = "climb"
    HOLD = "hold"
    FAILSAFE = "failsafe"  # the autopilot flies by itself, or its estimate is lost: no commands


# Phases in which slz commands the vehicle.
COMMANDING = frozenset({Phase.SURVEY, Phase.APPROACH, Phase.DESCEND, Phase.FINAL, Phase.CLIMB, Phase.HOLD})


class MissingInput(Enum):
    """Inputs without which nothing is judged: what is missing, and how."""

    LINK_LOST = "link", "lost"
    LIDAR_LOST = "LiDAR", "lost"
    SCANS_LATE = "scans", "late"
    MAP_LATE = "map", "late"
    MAP_BEGINS = "map", "begun anew"  # the position jumped, or the pilot asked for it
    MAP_INVALID = "map", "invalid"
    POSITION_LOST = "position", "lost"

    def __init__(self, thing: str, state: str) -> None:
        self.thing, self.state = thing, state

    @property
    def text(self) -> str:
        """Text for the pilot."""
        return f"{self.thing} {self.state}"


class Severity(Enum):
    """MAVLink STATUSTEXT severities in use."""

    CRITICAL = 2
    WARNING = 4
    NOTICE = 5
    INFO = 6


@dataclass(frozen=True, slots=True)
class Situation:
    """Present inputs. Positions and velocities are east, north, up in the map frame.

    guided, landing: the autopilot is in the mode that obeys setpoints, or in its landing mode. on_ground:
    None if not reported. lidar_ok: scans arrive and are georeferenced. no_map_reason: why scans or map
    are missing; valid while lidar_ok is False. report: the newest one, or None. battery_pct: charge left,
    None if not reported. blocked, blocked_above: an obstacle in the direction of the last velocity, ahead or
    above. heard: a heartbeat a moment ago confirms the mode. epoch: changes with each jump of the position
    estimate.

    failsafe: reported by the autopilot. breached: outside its fence. estimate_lost: parts of the estimate
    that were valid and are lost. gps_lost: no receiver has a fix any more; the estimate drifts.
    gps_glitching: the estimator rejects what GPS measures. tracked: the
    LiDAR odometry knows the place on the map, or did three seconds ago; None while it is off. gps_drift_m:
    how far the estimate went off the map in the last ten seconds, by the odometry. place_by: what the
    odometry is called, "LiDAR" or "odometry". cause: reason of the
    failsafe. target_lost_ns: last time at which the autopilot reported the landing target lost. sticks_us:
    the pilot's roll and pitch stick, None if not seen. switched: a switch of the pilot's transmitter moved
    within the last seconds. fit: the autopilot is known to be set up for a landing. heading_rad: of the
    nose, clockwise from north. below: surface of the ground under the vehicle. wind: None while it is
    unknown. intrusion: what came onto the selected point since the report, or None.
    moving: what moves around the vehicle. no_command_reason: why a vehicle of this type, or in this state
    of flight, must not be commanded; "" if it may. fence: the autopilot's, as far as it is known.
    asked_enu_ms: velocity of the last step's setpoint as it was sent, None without one. commander: whose
    target the autopilot follows in its guided mode, "" while it is ours. judged_ns: time of the newest report
    of the present map, None before the first. lands_itself: the autopilot is in a landing of its own or of
    slz; follows_target: LANDING_TARGET leads it there.
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
    no_map_reason: MissingInput = MissingInput.LIDAR_LOST
    failsafe: bool = False
    breached: bool = False
    estimate_lost: str = ""
    gps_lost: bool = False
    gps_glitching: bool = False
    tracked: bool | None = None
    gps_drift_m: float = 0.0
    place_by: str = "LiDAR"
    cause: str = ""
    target_lost_ns: int | None = None
    sticks_us: tuple[int, int] | None = None
    switched: bool = False
    fit: bool = True
    heading_rad: float | None = None
    below: SurfaceHere = UNKNOWN_SURFACE
    wind: Wind | None = None
    blocked_above: bool = False
    intrusion: Intrusion | None = None
    moving: tuple[MovingObject, ...] = ()
    no_command_reason: str = ""
    fence: Geofence = NO_FENCE
    asked_enu_ms: Vector | None = None
    commander: str = ""
    judged_ns: int | None = None
    lands_itself: bool = False
    follows_target: bool = False


@dataclass(frozen=True, slots=True)
class VehicleCommands:
    """Commands of one step, from the executive to the vehicle.

    velocity_enu_ms: setpoint, None for none. yaw_rad: heading to turn to, None to keep it. mode: kind of mode
    to request. target_enu_m: landing target to stream. select_enu_m: point to select. lasting: text about
    what the landing waits for, as long as it does.
    """

    velocity_enu_ms: Vector | None = None
    yaw_rad: float | None = None
    mode: Literal["guided", "land"] | None = None
    target_enu_m: Vector | None = None
    select_enu_m: Vector | None = None
    texts: tuple[tuple[Severity, str], ...] = ()
    lasting: str = ""


@dataclass(frozen=True, slots=True)
class Emergency:
    """Zone of an emergency order given now, time until touchdown, and whether the battery lasts.

    seconds: infinite where the wind is too strong for every zone. within_battery: None while it is unknown
    how long the battery lasts.
    """

    zone_id: int
    seconds: float
    within_battery: bool | None


@dataclass(frozen=True, slots=True)
class Reply:
    """Answer to an operator: accepted or not, and the reason; asks: refused until it is confirmed."""

    accepted: bool
    reason: str
    asks: bool = False


@dataclass(slots=True)
class Tally:
    """Events so far, for the summary.

    failsafes: cause of each. landed_enu_m: place of the last touchdown; off_point_m: its distance to the
    point. None before.
    """

    aborts: int = 0
    abort_reasons: list[str] = field(default_factory=list)
    hands_off: int = 0
    failsafes: list[str] = field(default_factory=list)
    landed_enu_m: Vector | None = None
    off_point_m: float | None = None
    zone_id: int | None = None
    chosen_enu_m: Vector | None = None


@dataclass(frozen=True, slots=True)
class LandingRequest:
    """The operator's request: a point, or None for the best zone; urgent: the one reached soonest.

    confirmed: kind of surface at the point, if the operator confirmed the landing on it.
    """

    enu_m: Vector | None = None
    zone_id: int | None = None
    urgent: bool = False
    confirmed: SurfaceKind | None = None


def known(vector: Vector | None) -> Vector:
    """Return a position or velocity that the caller has made sure of; RuntimeError without one."""
    if vector is None:
        raise RuntimeError("position unknown")
    return vector
