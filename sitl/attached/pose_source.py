"""Pose of another simulator's vehicle, decoded from its autopilot's messages, without I/O."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from sitl.vehicle.rigid_body import multiply

SECOND_NS = 1_000_000_000
# The control loop on the simulator's rate settles within a second or two.
PULL_PER_S = 2.0
RATE_PULL_PER_S2 = 1.0
# A delayed message changes the estimate by no more than this.
MOST_NS = 20_000_000
# If this many consecutive messages are late by more than this, or one is early by more, the simulator lost or
# made up time.
SLIP_NS = 15_000_000
SLIP_COUNT = 20
# Beyond this error, the simulator was paused, and the sensor with it.
PAUSE_NS = 1_000_000_000
F64 = NDArray[np.float64]
Kind = Literal["ardupilot", "px4", "other"]
Place = tuple[float, float, float]
POSE_HZ = 100.0
# An autopilot without a true pose for this long after its estimate does not send any.
PATIENCE_NS = 3_000_000_000
TRUE_POSE: dict[Kind, str] = {"ardupilot": "SIM_STATE", "px4": "HIL_STATE_QUATERNION"}
STANDING_M: dict[Kind, float] = {"ardupilot": 0.1}
"""Height of the true pose above ground when landed; 0 for other autopilots (SITL's frame_height).
"""
# MAV_TYPE of other autopilots on a shared line: antenna tracker, station, rover, boat, submarine.
NO_AIRCRAFT = frozenset({5, 6, 10, 11, 12})


class SensorTime:
    """Conversion of an autopilot's time since boot to a clock of real seconds.

    A simulator in real time may run some percent slow, unlike the quartz of a real sensor, and a receiver
    designed for quartz clocks would misplace such stamps by a tenth of a second. So a control loop follows
    the rate between the two clocks smoothly: a delayed message must not move the stamps. On a busy computer
    the simulator loses time in steps. The sensor's clock does not, and its stamps continue with real time.
    """

    def __init__(self) -> None:
        self._boot_ns: int | None = None
        self._arrival_ns = 0  # the arrival, on the sensor's clock, minus the real time
        self._offset_ns = 0.0  # the sensor's clock minus the time since boot
        self._rate = 0.0
        self._errors_ns: deque[float] = deque(maxlen=SLIP_COUNT)

    @property
    def running(self) -> bool:
        """True if `restart` was called."""
        return self._boot_ns is not None

    def restart(self, boot_ns: int, arrival_ns: int, at_ns: int) -> None:
        """Start or restart: this boot time, received at this real time, is the sensor's time `at_ns`."""
        self._boot_ns, self._arrival_ns = boot_ns, at_ns - arrival_ns
        self._offset_ns, self._rate = float(at_ns - boot_ns), 0.0
        self._errors_ns.clear()

    def to_sensor_ns(self, boot_ns: int, arrival_ns: int | None) -> int:
        """Return the sensor's time of a boot time received at a real time.

        None marks a message that waited unread for an unknown time and so carries no information on the rate.
        """
        step_s = max(0, boot_ns - (self._boot_ns or 0)) / SECOND_NS
        self._boot_ns = max(boot_ns, self._boot_ns or 0)
        self._offset_ns += self._rate * step_s
        if arrival_ns is None:
            return boot_ns + round(self._offset_ns)
        error_ns = arrival_ns + self._arrival_ns - boot_ns - self._offset_ns
        if abs(error_ns) > PAUSE_NS:
            self._arrival_ns -= round(error_ns)
            error_ns = 0.0
            self._errors_ns.clear()
        error_ns -= self._slipped_ns(error_ns)
        pull_ns = max(-MOST_NS, min(MOST_NS, error_ns))
        share = min(step_s, 0.1)
        self._rate += RATE_PULL_PER_S2 * share * pull_ns
        self._offset_ns += PULL_PER_S * share * pull_ns
        return boot_ns + round(self._offset_ns)

    def _slipped_ns(self, error_ns: float) -> float:
        """Correct a step of the simulator's time at once; return it, 0 without one."""
        self._errors_ns.append(error_ns)
        lost_ns = min(self._errors_ns) if len(self._errors_ns) == SLIP_COUNT else 0.0
        slip_ns = error_ns if error_ns < -SLIP_NS else lost_ns if lost_ns > SLIP_NS else 0.0
        if slip_ns:
            self._offset_ns += slip_ns
            self._errors_ns.clear()
        return slip_ns


@dataclass(frozen=True, slots=True)
class Pose:
    """Pose at a time since boot; lla is latitude, longitude (degrees), altitude above mean sea level (m).

    quat_wxyz: (4,) unit, body forward-right-down to north-east-down.
    """

    boot_ns: int
    lla: Place
    quat_wxyz: F64


@dataclass(frozen=True, slots=True)
class Stream:
    """Message and its requested rate."""

    message_id: int
    rate_hz: float


def streams(kind: Kind) -> tuple[Stream, ...]:
    """Return the streams to request from an autopilot, the most needed first.

    ArduPilot sends messages of one rate together, so that SIM_STATE, which has no stamp, follows an
    ATTITUDE_QUATERNION of the same time. PX4 sends them one after the other: HIL_STATE_QUATERNION, which has
    no stamp either, follows 4 ms later.
    """
    own: tuple[Stream, ...] = ()
    if kind == "ardupilot":
        own = (Stream(mavlink.MAVLINK_MSG_ID_SIM_STATE, POSE_HZ),)
    elif kind == "px4":
        own = (Stream(mavlink.MAVLINK_MSG_ID_HIL_STATE_QUATERNION, POSE_HZ),)
    return (
        Stream(mavlink.MAVLINK_MSG_ID_ATTITUDE_QUATERNION, POSE_HZ),
        *own,
        Stream(mavlink.MAVLINK_MSG_ID_GLOBAL_POSITION_INT, POSE_HZ / 2),
        Stream(mavlink.MAVLINK_MSG_ID_EXTENDED_SYS_STATE, 5.0),
        Stream(mavlink.MAVLINK_MSG_ID_HOME_POSITION, 1.0),
    )


class PoseSource:
    """Decoder of poses from messages: true poses if available, else the autopilot's estimate.

    Attributes
    ----------
    kind, sysid
        The autopilot and its system ID; None before its first heartbeat. The first aircraft heard is used.
    source
        Name of the message that poses come from, "" before the first.
    armed, on_ground
        Reported state; on_ground is None without a report.
    home_lla
        Reported home, None while unknown.
    mode
        Custom mode number of its heartbeat.
    """

    def __init__(self) -> None:
        self.kind: Kind | None = None
        self.sysid: int | None = None
        self.restart()

    def restart(self) -> None:
        """Discard everything except the autopilot's identity: it rebooted, or the wire is a new one."""
        self.source = ""
        self.armed = False
        self.on_ground: bool | None = None
        self.home_lla: Place | None = None
        self.mode = 0
        self._attitude: tuple[int, F64, F64] | None = None
        self._first_ns: int | None = None

    def on_message(self, message: Any) -> Pose | None:
        """Return the pose that a message completes, None without one."""
        name = message.get_type()
        if name == "HEARTBEAT":
            self._heartbeat(message)
        if self.sysid is None or message.get_srcSystem() != self.sysid or message.get_srcComponent() != 1:
            return None
        reader = _READERS.get(name)
        return None if reader is None else reader(self, message)

    @property
    def standing_m(self) -> float:
        """Height of the poses above the ground when the vehicle stands on it."""
        true = self.kind is not None and self.source == TRUE_POSE.get(self.kind)
        return STANDING_M.get(self.kind or "other", 0.0) if true else 0.0

    # ---- messages -------------------------------------------------------------------------------

    def _heartbeat(self, m: Any) -> None:
        if m.get_srcComponent() != 1 or m.autopilot == mavlink.MAV_AUTOPILOT_INVALID:
            return
        if self.sysid is None and m.type in NO_AIRCRAFT:
            return
        if self.sysid is None:
            self.sysid = int(m.get_srcSystem())
            kinds: dict[int, Kind] = {
                mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA: "ardupilot",
                mavlink.MAV_AUTOPILOT_PX4: "px4",
            }
            self.kind = kinds.get(m.autopilot, "other")
        if m.get_srcSystem() == self.sysid:
            self.armed = bool(m.base_mode & mavlink.MAV_MODE_FLAG_SAFETY_ARMED)
            self.mode = int(m.custom_mode)

    def _attitude_quaternion(self, m: Any) -> Pose | None:
        quat = _unit(m.q1, m.q2, m.q3, m.q4)
        rates = np.array([m.rollspeed, m.pitchspeed, m.yawspeed], np.float64)
        if quat is not None and np.isfinite(rates).all():
            self._attitude = m.time_boot_ms * 1_000_000, quat, rates
        return None

    def _sim_state(self, m: Any) -> Pose | None:
        if self._attitude is None:
            return None  # no stamp yet
        place = _place(m.lat_int, m.lon_int, m.alt)
        return self._true("SIM_STATE", self._attitude[0], place, _unit(m.q1, m.q2, m.q3, m.q4))

    def _hil_state(self, m: Any) -> Pose | None:
        boot_ns = m.time_usec * 1000
        if boot_ns == 0:  # PX4 omits it
            if self._attitude is None:
                return None
            boot_ns = self._attitude[0]
        place = _place(m.lat, m.lon, m.alt / 1000)
        return self._true("HIL_STATE_QUATERNION", boot_ns, place, _unit(*m.attitude_quaternion))

    def _true(self, name: str, boot_ns: int, place: Place | None, quat: F64 | None) -> Pose | None:
        if quat is None or place is None:
            return None
        self.source = name
        return Pose(boot_ns, place, quat)

    def _global_position(self, m: Any) -> Pose | None:
        place = _place(m.lat, m.lon, m.alt / 1000)
        if place is None or self._attitude is None:
            return None
        boot_ns = m.time_boot_ms * 1_000_000
        if self._first_ns is None or boot_ns < self._first_ns:
            self._first_ns = boot_ns
        if self.source not in ("", "GLOBAL_POSITION_INT") or (
            self.kind in TRUE_POSE and boot_ns - self._first_ns < PATIENCE_NS
        ):
            return None
        self.source = "GLOBAL_POSITION_INT"
        return Pose(boot_ns, place, _turned(*self._attitude, boot_ns))

    def _home(self, m: Any) -> Pose | None:
        self.home_lla = _place(m.latitude, m.longitude, m.altitude / 1000) or self.home_lla
        return None

    def _landed(self, m: Any) -> Pose | None:
        self.on_ground = None if m.landed_state == 0 else m.landed_state == 1
        return None


def _unit(w: float, x: float, y: float, z: float) -> F64 | None:
    quat = np.array([w, x, y, z], np.float64)
    norm = float(np.linalg.norm(quat))
    return quat / norm if 0.9 < norm < 1.1 else None


def _place(lat_e7: int, lon_e7: int, alt_m: float) -> Place | None:
    if (lat_e7 == 0 and lon_e7 == 0) or not math.isfinite(alt_m):
        return None
    return lat_e7 * 1e-7, lon_e7 * 1e-7, float(alt_m)


def _turned(stamp_ns: int, quat: F64, rates_rad_s: F64, at_ns: int) -> F64:
    """Return an attitude extrapolated with its rates to another time (by at most 50 ms)."""
    half = rates_rad_s * 0.5e-9 * max(-50_000_000, min(50_000_000, at_ns - stamp_ns))
    angle = float(np.linalg.norm(half))
    if angle < 1e-9:
        return quat
    return multiply(quat, np.array([math.cos(angle), *(half * (math.sin(angle) / angle))]))


_READERS: dict[str, Callable[[PoseSource, Any], Pose | None]] = {
    "ATTITUDE_QUATERNION": PoseSource._attitude_quaternion,
    "SIM_STATE": PoseSource._sim_state,
    "HIL_STATE_QUATERNION": PoseSource._hil_state,
    "GLOBAL_POSITION_INT": PoseSource._global_position,
    "HOME_POSITION": PoseSource._home,
    "EXTENDED_SYS_STATE": PoseSource._landed,
}
