"""Interface of the autopilots: everything in which one may differ from another, as data and a few rules.

`ardupilot.py` and `px4.py` beside this file describe one each. The rest of the program never asks for a name:
it asks the object in `VehicleState.autopilot`. What is not given here is as for an autopilot that is unknown:
no modes, nothing commanded.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from params import Required, required


@dataclass(frozen=True, slots=True)
class Stream:
    """Message and its requested rate.

    needed: False for a message that some autopilots never send; if refused, it is not requested again.
    steady_hz: highest rate that arrives if the message is sent on change; None means `rate_hz`.
    """

    name: str
    message_id: int
    rate_hz: float
    needed: bool = True
    steady_hz: float | None = None

    @property
    def arrives_hz(self) -> float:
        """Rate on a healthy link."""
        return self.rate_hz if self.steady_hz is None else self.steady_hz

    @property
    def interval_us(self) -> int:
        return round(1e6 / self.rate_hz)


@dataclass(frozen=True, slots=True)
class FenceLimits:
    """Limits that the parameters of a fence set; heights above home.

    margin_m, height_margin_m: kept by the autopilot itself. is_union: whether to be in one area of inclusion
    is enough. has_areas: whether the areas of the fence's items act.
    """

    radius_m: float = math.inf
    lowest_m: float = -math.inf
    highest_m: float = math.inf
    margin_m: float = 0.0
    height_margin_m: float = 0.0
    is_union: bool = False
    has_areas: bool = True


@dataclass(frozen=True, slots=True)
class FenceRules:
    """Parameters of the autopilot's fence, and their meaning.

    needed: names; an autopilot that lacks the first has no fence. versions: names that some versions lack,
    and the value without. limits: from the values, and whether SYS_STATUS reports the fence as enabled, to
    the limits; None while the fence does not act. Without parameters there is no fence.
    """

    needed: tuple[str, ...] = ()
    versions: Mapping[str, float] = field(default_factory=dict)
    limits: Callable[[Mapping[str, float], bool], FenceLimits | None] = lambda values, enabled: None


@dataclass(frozen=True, slots=True)
class ExternalPosition:
    """ODOMETRY as the autopilot's estimator accepts it.

    frame, estimator: MAV_FRAME of the pose, MAV_ESTIMATOR_TYPE. oldest_ns: age of a measurement beyond which
    it is not used. delay_ns: from a measurement to its stamp, and to the earliest time of sending.
    needs_clock: whether the autopilot takes the companion's clock from stamps alone, see `clock_message`.
    """

    frame: int
    estimator: int
    oldest_ns: int
    delay_ns: int = 0
    needs_clock: bool = False


@dataclass(frozen=True, slots=True)
class LandingMode:
    """Mode in which the autopilot lands by itself.

    follows_target: whether LANDING_TARGET leads it there. at_end: it lands in its last part only, which it
    reports as MAV_LANDED_STATE_LANDING. switch: the parameter without which, at 0, it follows none.
    """

    follows_target: bool = True
    at_end: bool = False
    switch: str = ""


def _nothing_commanded(vehicle_type: int, vtol_state: int | None, is_plane: bool) -> str:
    return "unknown autopilot"


# As often as a failsafe, the pilot's sticks or another wind have to be noticed.
ESTIMATOR = Stream("EKF_STATUS_REPORT", mavlink.MAVLINK_MSG_ID_EKF_STATUS_REPORT, 5.0, needed=False)
STICKS = Stream("RC_CHANNELS", mavlink.MAVLINK_MSG_ID_RC_CHANNELS, 5.0, needed=False)
FENCE = Stream("FENCE_STATUS", mavlink.MAVLINK_MSG_ID_FENCE_STATUS, 2.0, needed=False)
WIND = Stream("WIND", mavlink.MAVLINK_MSG_ID_WIND, 2.0, needed=False)  # where it estimates one


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Autopilot:
    """Autopilot software, in all that the companion must know of it. Two are the same if they are one object.

    Attributes
    ----------
    name
        In documents and recordings.
    title, firmware
        For people: the project, and its program for multirotors.
    mav_autopilot
        MAV_AUTOPILOT of its heartbeat.
    versions
        Oldest and newest version, major and minor, for which this was written and read.
    modes
        Parameters 2 and 3 of MAV_CMD_DO_SET_MODE by the mode's name.
    unpack_mode
        From HEARTBEAT.custom_mode to these two numbers.
    mode_types
        MAV_TYPE of the vehicles with these modes, None for all.
    guided_mode, landing_mode
        Names of the mode that follows our setpoints, and of the one that lands at our target.
    own_landings
        Modes in which it lands by itself, whoever set them.
    no_command_reason
        From MAV_TYPE, MAV_VTOL_STATE or `VTOL_UNHEARD` (None before the first), and whether it has its
        `plane_parameter`, to the reason not to command such a vehicle, "" if it may be. Users may set the
        MAV_TYPE, so the state of a VTOL counts more.
    plane_parameter
        Parameter that a version for fixed wings alone has, which may pose as one for multirotors.
    mode_stream
        Message that has the mode soonest.
    own_streams
        Messages of estimator, sticks, fence and wind.
    overtaken_ns
        Time in which it sends fewer than 128 messages, half of the sequence numbers.
    wind_heading_is_towards
        Whether HIGH_LATENCY2.wind_heading is the direction towards which the wind blows, not from which.
    bytewise_parameters
        Whether integers are sent by their bytes, not by value.
    parameter_file, odometry_file
        Files of `params/autopilot` with required parameters, and with those for the LiDAR odometry. Without
        the first no landing begins by itself.
    fence
        None if it may have one that is not read: no landing begins by itself.
    landing_target_frame
        MAV_FRAME of LANDING_TARGET: BODY_FRD or LOCAL_NED.
    open_signal_ns
        Interval of the setpoints without which it does not enter or keep the guided mode; None without.
    external_position
        None if it does not get the LiDAR odometry.
    second_source
        Parameters by which the odometry is the second set of sources, which must be switched to; empty for
        an autopilot without sets.
    takes_obstacle_points
        Whether it uses OBSTACLE_DISTANCE_3D.
    backs_off_ms
        Speed of its avoidance, which may turn, shorten or reverse a velocity; None: it shortens only.
    obeys_reposition
        Whether DO_REPOSITION of anyone leads it away in the guided mode.
    reports_guided_points
        Whether POSITION_TARGET_GLOBAL_INT and the distance in NAV_CONTROLLER_OUTPUT mean, in the guided mode,
        that it flies to a point.
    """

    name: str
    title: str = "unknown"
    firmware: str = ""
    mav_autopilot: int | None = None
    versions: tuple[tuple[int, int], tuple[int, int]] | None = None

    modes: Mapping[str, tuple[int, int]] = field(default_factory=dict)
    unpack_mode: Callable[[int], tuple[int, int]] = lambda custom_mode: (custom_mode, 0)
    mode_types: frozenset[int] | None = None
    guided_mode: str | None = None
    landing_mode: str | None = None
    own_landings: Mapping[str, LandingMode] = field(default_factory=dict)
    no_command_reason: Callable[[int, int | None, bool], str] = _nothing_commanded
    plane_parameter: str | None = None

    mode_stream: Stream = Stream("HEARTBEAT", mavlink.MAVLINK_MSG_ID_HEARTBEAT, 5.0)
    own_streams: tuple[Stream, ...] = (ESTIMATOR, STICKS, FENCE, WIND)
    overtaken_ns: int = 400_000_000
    wind_heading_is_towards: bool = False

    bytewise_parameters: bool = False
    parameter_file: str | None = None
    odometry_file: str | None = None
    fence: FenceRules | None = None

    landing_target_frame: int = mavlink.MAV_FRAME_BODY_FRD
    open_signal_ns: int | None = None
    external_position: ExternalPosition | None = None
    second_source: Mapping[str, float] = field(default_factory=dict)
    takes_obstacle_points: bool = False

    backs_off_ms: float | None = None
    obeys_reposition: bool = False
    reports_guided_points: bool = False

    def __repr__(self) -> str:
        return self.name

    @property
    def needs_local_position(self) -> bool:
        """True if something is always sent in its local frame."""
        in_its_frame = self.landing_target_frame == mavlink.MAV_FRAME_LOCAL_NED
        return in_its_frame or self.open_signal_ns is not None

    def mode_name(self, vehicle_type: int, custom_mode: int) -> str:
        """Return the name of a mode; `MODE(n)` if it is unknown here."""
        numbers = self.unpack_mode(custom_mode)
        found = (name for name, known in self._modes_of(vehicle_type).items() if known == numbers)
        return next(found, f"MODE({custom_mode})")

    def mode_parameters(self, vehicle_type: int, name: str) -> tuple[float, float] | None:
        """Return parameters 2 and 3 of MAV_CMD_DO_SET_MODE for a mode, None if it is unknown."""
        numbers = self._modes_of(vehicle_type).get(name)
        return None if numbers is None else (float(numbers[0]), float(numbers[1]))

    def required(self, odometry: bool = False) -> tuple[Required, ...]:
        """Return the required parameters; odometry: whether the LiDAR odometry is sent to the autopilot."""
        files = (self.parameter_file, self.odometry_file if odometry else None)
        return required(*(file for file in files if file is not None))

    def _modes_of(self, vehicle_type: int) -> Mapping[str, tuple[int, int]]:
        return self.modes if self.mode_types is None or vehicle_type in self.mode_types else {}


UNKNOWN = Autopilot(name="unknown")  # before the first heartbeat
OTHER = Autopilot(name="other")
