"""Health reported by the autopilot: estimator, sensors, fence, failsafe, and the pilot's sticks."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from companion.runtime.frozen_record import replaced

# EKF_STATUS_REPORT (ArduPilot) and ESTIMATOR_STATUS (PX4) use the same bits for these flags.
ATTITUDE: int = mavlink.EKF_ATTITUDE
VELOCITY: int = mavlink.EKF_VELOCITY_HORIZ
POSITION: int = mavlink.EKF_POS_HORIZ_ABS
HEIGHT: int = mavlink.EKF_POS_VERT_ABS
# The bit by which each message reports a GPS that the estimator rejects: the other's means something else.
GLITCH: dict[str, int] = {
    "EKF_STATUS_REPORT": mavlink.EKF_GPS_GLITCHING,
    "ESTIMATOR_STATUS": mavlink.ESTIMATOR_GPS_GLITCH,
}
DEAD_RECKONING_NS = 15_000_000_000  # an estimator that keeps its position for longer has it from elsewhere
FIX_HOLD_NS = 3_000_000_000  # for which a receiver's fix counts after its message
NEEDED = {ATTITUDE: "attitude", POSITION: "position", VELOCITY: "velocity", HEIGHT: "height"}

# SYS_STATUS: a pilot's phrase for each unhealthy sensor, the most important first.
SENSORS: dict[int, str] = {
    mavlink.MAV_SYS_STATUS_AHRS: "attitude lost",
    mavlink.MAV_SYS_STATUS_SENSOR_GPS: "GPS lost",
    mavlink.MAV_SYS_STATUS_SENSOR_BATTERY: "battery low",
    mavlink.MAV_SYS_STATUS_SENSOR_RC_RECEIVER: "RC lost",
    mavlink.MAV_SYS_STATUS_GEOFENCE: "fence breached",
    mavlink.MAV_SYS_STATUS_SENSOR_3D_MAG: "compass lost",
}
FAILSAFE_STATES = frozenset(
    {mavlink.MAV_STATE_CRITICAL, mavlink.MAV_STATE_EMERGENCY, mavlink.MAV_STATE_FLIGHT_TERMINATION}
)
ALARM_NS = 10_000_000_000  # an older text does not explain a failsafe; PX4 acts 5 s after it (COM_FAIL_ACT_T)
ALARM_SEVERITY: int = mavlink.MAV_SEVERITY_WARNING  # ArduCopter uses it for battery and radio failsafes
TARGET_LOST = "target lost"  # ArduPilot's text; it follows an aborted landing and is no cause of a failsafe
MOVED_US = 100  # a switch moved by the pilot; receiver noise is smaller
NO_CHANNEL = frozenset({0, 0xFFFF})
NO_AXIS = 0x7FFF


@dataclass(frozen=True, slots=True)
class Health:
    """Health as last reported; None is not reported.

    Attributes
    ----------
    estimator, estimator_had
        Flags of the estimator now, and all flags set since the autopilot booted.
    unhealthy
        Bits of SYS_STATUS: sensors that are enabled and do not work.
    glitching
        Whether the estimator rejects what GPS measures.
    fixed_ns
        Arrival of the newest message of each of two receivers, if it reported a 3D fix.
    had_fix, fixless_since_ns
        Whether any receiver ever had a 3D fix, and since when none has.
    is_placed_otherwise
        Whether the estimator has kept its position without GPS for longer than dead reckoning lasts.
    breached
        Whether the vehicle is outside its fence.
    fenced
        Whether SYS_STATUS reports the fence as enabled; a command or a switch may do so.
    alarm, alarm_ns
        Newest text of the autopilot of severity WARNING or worse except "target lost", and its arrival.
    target_lost_ns
        Arrival of the newest text that reports a lost landing target, None if never. It is kept apart so that
        another text at the same moment does not hide it.
    sticks_us
        Roll and pitch stick, microseconds of a transmitter's pulse.
    switches_us, switched_ns
        Channels 5 to 16, and the time at which one of them last moved.
    """

    estimator: int | None = None
    estimator_had: int = 0
    unhealthy: int = 0
    glitching: bool = False
    fixed_ns: tuple[int | None, int | None] = (None, None)
    had_fix: bool = False
    fixless_since_ns: int | None = None
    is_placed_otherwise: bool = False
    breached: bool = False
    fenced: bool = False
    alarm: str = ""
    alarm_ns: int = 0
    target_lost_ns: int | None = None
    sticks_us: tuple[int, int] | None = None
    switches_us: tuple[int, ...] = ()
    switched_ns: int | None = None

    @property
    def estimate_lost(self) -> str:
        """First estimate that the estimator had and has lost; empty while its estimate can be trusted."""
        if self.estimator is None:
            return ""
        lost = self.estimator_had & ~self.estimator
        names = [name for flag, name in NEEDED.items() if lost & flag]
        return names[0] if names else ""

    @property
    def fix_lost(self) -> bool:
        """True if the receivers had a 3D fix and none has one now."""
        return self.fixless_since_ns is not None

    @property
    def gps_lost(self) -> bool:
        """True if the estimator must soon fail for want of GPS."""
        return self.fix_lost and not self.is_placed_otherwise

    def cause(self, now_ns: int) -> str:
        """Return the reported cause of a failsafe, or an empty string."""
        if self.alarm and now_ns - self.alarm_ns <= ALARM_NS:
            return self.alarm
        if self.breached:
            return "fence breached"
        if self.estimate_lost:
            return f"{self.estimate_lost} lost"
        if self.gps_lost:
            return "GPS lost"
        return next((words for bit, words in SENSORS.items() if self.unhealthy & bit), "")


def reduce(health: Health, message: Any, now_ns: int) -> Health:
    """Return the health updated with a message of the autopilot."""
    reducer = _REDUCERS.get(message.get_type())
    return health if reducer is None else reducer(health, message, now_ns)


def _estimator(health: Health, m: Any, now_ns: int) -> Health:
    since_ns = health.fixless_since_ns
    lasting = since_ns is not None and now_ns - since_ns > DEAD_RECKONING_NS
    return replaced(
        health,
        estimator=m.flags,
        estimator_had=health.estimator_had | m.flags,
        glitching=bool(m.flags & GLITCH[m.get_type()]),
        is_placed_otherwise=lasting and bool(m.flags & POSITION),
    )


def _sys_status(health: Health, m: Any, now_ns: int) -> Health:
    enabled = m.onboard_control_sensors_present & m.onboard_control_sensors_enabled
    fenced = bool(enabled & mavlink.MAV_SYS_STATUS_GEOFENCE)
    return replaced(health, unhealthy=enabled & ~m.onboard_control_sensors_health, fenced=fenced)


def _gps(health: Health, m: Any, now_ns: int) -> Health:
    fixed_ns = now_ns if m.fix_type >= mavlink.GPS_FIX_TYPE_3D_FIX else None
    first_ns, second_ns = health.fixed_ns
    both = (fixed_ns, second_ns) if m.get_type() == "GPS_RAW_INT" else (first_ns, fixed_ns)
    if any(at_ns is not None and now_ns - at_ns < FIX_HOLD_NS for at_ns in both):
        return replaced(health, fixed_ns=both, had_fix=True, fixless_since_ns=None, is_placed_otherwise=False)
    since_ns = health.fixless_since_ns
    since_ns = now_ns if since_ns is None and health.had_fix else since_ns
    return replaced(health, fixed_ns=both, fixless_since_ns=since_ns)


def _fence(health: Health, m: Any, now_ns: int) -> Health:
    return replaced(health, breached=m.breach_status != 0)


def _text(health: Health, m: Any, now_ns: int) -> Health:
    if m.severity > ALARM_SEVERITY or getattr(m, "chunk_seq", 0) != 0:
        return health
    words = str(m.text).strip()
    if TARGET_LOST in words.lower():
        return replaced(health, target_lost_ns=now_ns)
    return replaced(health, alarm=words, alarm_ns=now_ns)


def _channels(health: Health, m: Any, now_ns: int) -> Health:
    if m.chan1_raw not in NO_CHANNEL and m.chan2_raw not in NO_CHANNEL:
        health = replaced(health, sticks_us=(m.chan1_raw, m.chan2_raw))
    switches = tuple(getattr(m, f"chan{number}_raw") for number in range(5, 17))
    moved = any(
        abs(new - old) > MOVED_US
        for old, new in zip(health.switches_us, switches, strict=False)
        if old not in NO_CHANNEL and new not in NO_CHANNEL
    )
    return replaced(health, switches_us=switches, switched_ns=now_ns if moved else health.switched_ns)


def _manual_control(health: Health, m: Any, now_ns: int) -> Health:
    """Use PX4's MANUAL_CONTROL: -1000 to 1000, x pitch, y roll."""
    if NO_AXIS in (m.x, m.y):
        return health
    return replaced(health, sticks_us=(1500 + m.y // 2, 1500 + m.x // 2))


_REDUCERS: dict[str, Callable[[Health, Any, int], Health]] = {
    "EKF_STATUS_REPORT": _estimator,
    "ESTIMATOR_STATUS": _estimator,
    "SYS_STATUS": _sys_status,
    "GPS_RAW_INT": _gps,
    "GPS2_RAW": _gps,
    "FENCE_STATUS": _fence,
    "STATUSTEXT": _text,
    "RC_CHANNELS": _channels,
    "MANUAL_CONTROL": _manual_control,
}
