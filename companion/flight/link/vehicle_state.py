"""Vehicle state: the autopilot's messages reduced, one by one, to an immutable snapshot."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, Literal

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from companion.flight.link import autopilot_health as health
from companion.flight.link.autopilot_health import FAILSAFE_STATES, Health
from companion.flight.link.autopilots.autopilot_interface import UNKNOWN, Autopilot, LandingMode
from companion.flight.link.autopilots.autopilot_registry import autopilot_of
from companion.flight.link.clock.message_order import STAYS_MS, MessageOrder
from companion.flight.link.position_fix import MESSAGES as FIX_MESSAGES
from companion.flight.link.position_fix import PositionFix
from companion.flight.link.vehicle_class import VTOL_HOVERS, VTOL_UNHEARD
from companion.runtime.frozen_record import replaced

Landed = Literal["unknown", "on_ground", "in_air", "takeoff", "landing"]
Vector = tuple[float, float, float]
Quaternion = tuple[float, float, float, float]

# Height above home at which an armed vehicle certainly flies, if it does not report its landed state.
AIRBORNE_M = 2.0
MOST_ALT_MM = 100_000_000  # no aircraft flies so high: the number is none
# EXTENDED_SYS_STATE comes five times a second; without one so long, a VTOL may fly on its wing by now.
VTOL_STATE_NS = 2_500_000_000
_LANDED: dict[int, Landed] = {1: "on_ground", 2: "in_air", 3: "takeoff", 4: "landing"}
_STAMPED = frozenset(
    {"ATTITUDE", "ATTITUDE_QUATERNION", "GLOBAL_POSITION_INT", "LOCAL_POSITION_NED", "SYSTEM_TIME"}
)


@dataclass(frozen=True, slots=True)
class VehicleState:
    """Snapshot of the vehicle; None is unknown. A reboot clears most of it.

    Attributes
    ----------
    position_lla
        Latitude, longitude (degrees), altitude above mean sea level (m).
    velocity_ned_ms, local_ned_m
        North, east, down; `local_ned_m` from the autopilot's own origin.
    attitude_wxyz
        Unit quaternion that rotates body forward-right-down into north-east-down.
    position_boot_ms, local_boot_ms, boot_ms
        Autopilot's time of the position, of the local position, and of its newest message.
    order
        Distinction of late and repeated messages from new ones and from a restart.
    reboots
        Number of times that the autopilot's clock restarted.
    fix
        Reported quality of the position.
    heartbeat_seq, mode_seq
        8-bit sequence number of the newest heartbeat, and of the newest message with the mode, among all
        messages of the autopilot.
    mode_heard_ns
        Arrival of the newest mode, in HEARTBEAT or CURRENT_MODE.
    displaced
        Whether the mode is not the one that its pilot chose. CURRENT_MODE reports this a second before the
        heartbeat reports a failsafe.
    is_plane
        Whether the autopilot has its `plane_parameter`.
    vtol_state, vtol_heard_ns
        MAV_VTOL_STATE, and its newest arrival.
    health
        Reported health of estimator, sensors and fence, and the pilot's sticks.
    """

    sysid: int | None = None
    autopilot: Autopilot = UNKNOWN
    vehicle_type: int = 0
    is_plane: bool = False
    armed: bool = False
    mode: str = ""
    custom_mode: int = 0
    system_status: int = 0
    last_heartbeat_ns: int | None = None
    heartbeat_seq: int = 0
    mode_heard_ns: int | None = None
    mode_seq: int = 0
    displaced: bool = False
    reported_landed: Landed = "unknown"
    vtol_state: int | None = None
    vtol_heard_ns: int | None = None
    battery_pct: float | None = None
    battery_v: float | None = None
    home_lla: Vector | None = None
    fix: PositionFix = PositionFix()  # noqa: RUF009 - it is frozen
    position_lla: Vector | None = None
    position_boot_ms: int = 0
    relative_alt_m: float | None = None
    velocity_ned_ms: Vector | None = None
    heading_deg: float | None = None
    local_ned_m: Vector | None = None
    local_boot_ms: int = 0
    attitude_wxyz: Quaternion | None = None
    rates_rad_s: Vector | None = None
    boot_ms: int | None = None
    order: MessageOrder = MessageOrder()  # noqa: RUF009 - it is frozen
    reboots: int = 0
    health: Health = field(default_factory=Health)

    @property
    def landed(self) -> Landed:
        """Landed state: as reported, else as arming and height clearly imply."""
        if self.reported_landed != "unknown":
            return self.reported_landed
        if self.last_heartbeat_ns is None:
            return "unknown"
        if not self.armed:
            return "on_ground"
        if self.relative_alt_m is not None and self.relative_alt_m > AIRBORNE_M:
            return "in_air"
        return "unknown"

    @property
    def guided(self) -> bool:
        """True if the vehicle is in the mode that follows our setpoints."""
        return self.mode == self.autopilot.guided_mode

    @property
    def landing(self) -> bool:
        """True if the vehicle is in the mode that lands it at our target."""
        return self.mode == self.autopilot.landing_mode

    @property
    def own_landing(self) -> LandingMode | None:
        """The landing that the autopilot makes by itself now, None without one."""
        found = self.autopilot.own_landings.get(self.mode)
        if found is None or not self.armed or self.landed == "on_ground":
            return None
        return found if not found.at_end or self.reported_landed == "landing" else None

    @property
    def no_command_reason(self) -> str:
        """Reason not to command this vehicle in its present state of flight, "" if it may be.

        That a VTOL hovers counts as unknown once it is older than the newest heartbeat by `VTOL_STATE_NS`.
        """
        if self.last_heartbeat_ns is None:
            return ""
        late = self.last_heartbeat_ns - (self.vtol_heard_ns or 0) > VTOL_STATE_NS
        state = VTOL_UNHEARD if late and self.vtol_state == VTOL_HOVERS else self.vtol_state
        return self.autopilot.no_command_reason(self.vehicle_type, state, self.is_plane)

    @property
    def failsafe(self) -> bool:
        """True if the autopilot reports a failsafe of its own."""
        return self.system_status in FAILSAFE_STATES or (self.displaced and self.armed)


def is_autopilot(message: Any) -> bool:
    """Return whether a message is the heartbeat of an autopilot, not of a companion, camera or station."""
    return bool(
        message.get_type() == "HEARTBEAT"
        and message.get_srcComponent() == mavlink.MAV_COMP_ID_AUTOPILOT1
        and message.autopilot != mavlink.MAV_AUTOPILOT_INVALID
        and message.type != mavlink.MAV_TYPE_GCS
    )


def reduce(state: VehicleState, message: Any, now_ns: int, stays_ms: int = STAYS_MS) -> VehicleState:
    """Return the state updated with a message of the vehicle's autopilot.

    A message older than the newest of its kind changes nothing, by its stamp; nor does a heartbeat or mode
    that a later one has overtaken. `stays_ms`: see `MessageOrder.judge`.
    """
    kind = message.get_type()
    if kind in _STAMPED:
        order, verdict = state.order.judge(kind, message.time_boot_ms, now_ns, stays_ms)
    else:
        order, verdict = state.order.judge_other(message)
    if order is not state.order:
        state = _restarted(state, order) if verdict == "restart" else _ordered(state, order)
    if verdict == "old":
        return state
    if kind in FIX_MESSAGES:
        state = replaced(state, fix=state.fix.updated(message))
    reducer = _REDUCERS.get(kind)
    state = state if reducer is None else reducer(state, message, now_ns)
    found = health.reduce(state.health, message, now_ns)
    return state if found is state.health else replaced(state, health=found)


def note_time(state: VehicleState, boot_ms: int, now_ns: int) -> VehicleState:
    """Return the state updated with the boot time in the autopilot's answer to our own TIMESYNC."""
    order, verdict = state.order.answered(boot_ms, now_ns)
    return _restarted(state, order) if verdict == "restart" else _ordered(state, order)


def _ordered(state: VehicleState, order: MessageOrder) -> VehicleState:
    return state if order is state.order else replaced(state, order=order, boot_ms=order.newest_ms)


def _restarted(state: VehicleState, order: MessageOrder) -> VehicleState:
    """Return the state after a reboot: only what heartbeats say is still true."""
    return VehicleState(
        sysid=state.sysid,
        autopilot=state.autopilot,
        vehicle_type=state.vehicle_type,
        is_plane=state.is_plane,
        armed=state.armed,
        mode=state.mode,
        custom_mode=state.custom_mode,
        last_heartbeat_ns=state.last_heartbeat_ns,
        mode_heard_ns=state.mode_heard_ns,
        boot_ms=order.newest_ms,
        order=order,
        reboots=state.reboots + 1,
    )


def _heartbeat(state: VehicleState, m: Any, now_ns: int) -> VehicleState:
    if _overtaken(state.autopilot, m, state.heartbeat_seq, state.last_heartbeat_ns, now_ns):
        return state
    heard = replaced(
        state,
        sysid=m.get_srcSystem(),
        autopilot=autopilot_of(m.autopilot),
        vehicle_type=m.type,
        armed=bool(m.base_mode & mavlink.MAV_MODE_FLAG_SAFETY_ARMED),
        system_status=m.system_status,
        last_heartbeat_ns=now_ns,
        heartbeat_seq=m.get_seq(),
    )
    return _mode(heard, m, now_ns)


def _current_mode(state: VehicleState, m: Any, now_ns: int) -> VehicleState:
    reported = _mode(state, m, now_ns)
    if reported is state:
        return state
    return replaced(reported, displaced=m.intended_custom_mode not in (0, m.custom_mode))


def _mode(state: VehicleState, m: Any, now_ns: int) -> VehicleState:
    """Use the mode of a HEARTBEAT or CURRENT_MODE, whichever was sent later."""
    if state.sysid is None or _overtaken(state.autopilot, m, state.mode_seq, state.mode_heard_ns, now_ns):
        return state
    return replaced(
        state,
        mode=state.autopilot.mode_name(state.vehicle_type, m.custom_mode),
        custom_mode=m.custom_mode,
        mode_heard_ns=now_ns,
        mode_seq=m.get_seq(),
    )


def _overtaken(autopilot: Autopilot, m: Any, last_seq: int, last_ns: int | None, now_ns: int) -> bool:
    """Return whether a message was sent before the last one: it was delayed, or delivered twice.

    Its old mode would look like a change by the pilot. After `overtaken_ns` the 8-bit sequence numbers carry
    no order any more.
    """
    if last_ns is None or now_ns - last_ns > autopilot.overtaken_ns:
        return False
    return bool((m.get_seq() - last_seq) % 256 > 128)


def _extended_sys_state(state: VehicleState, m: Any, now_ns: int) -> VehicleState:
    landed = _LANDED.get(m.landed_state, "unknown")
    return replaced(state, reported_landed=landed, vtol_state=m.vtol_state, vtol_heard_ns=now_ns)


def _parameter(state: VehicleState, m: Any, now_ns: int) -> VehicleState:
    is_told = m.param_id.rstrip("\0") == state.autopilot.plane_parameter
    return replaced(state, is_plane=True) if is_told and not state.is_plane else state


def _sys_status(state: VehicleState, m: Any, now_ns: int) -> VehicleState:
    volts = m.voltage_battery / 1000 if 0 < m.voltage_battery < 0xFFFF else state.battery_v
    return replaced(state, battery_pct=_percent(m.battery_remaining, state.battery_pct), battery_v=volts)


def _battery_status(state: VehicleState, m: Any, now_ns: int) -> VehicleState:
    if m.id != 0:
        return state
    return replaced(state, battery_pct=_percent(m.battery_remaining, state.battery_pct))


def _percent(value: int, old: float | None) -> float | None:
    return float(value) if 0 <= value <= 100 else old


def _home_position(state: VehicleState, m: Any, now_ns: int) -> VehicleState:
    return replaced(state, home_lla=_lla(m.latitude, m.longitude, m.altitude) or state.home_lla)


def _global_position(state: VehicleState, m: Any, now_ns: int) -> VehicleState:
    lla = _lla(m.lat, m.lon, m.alt, zero=state.fix.good is True)
    if lla is None:
        return state
    return replaced(
        state,
        position_lla=lla,
        position_boot_ms=m.time_boot_ms,
        relative_alt_m=m.relative_alt / 1000,
        velocity_ned_ms=(m.vx / 100, m.vy / 100, m.vz / 100),
        heading_deg=m.hdg / 100 if m.hdg < 36_000 else state.heading_deg,
    )


def _local_position(state: VehicleState, m: Any, now_ns: int) -> VehicleState:
    local = (float(m.x), float(m.y), float(m.z))
    if not all(map(math.isfinite, local)):
        return state
    return replaced(state, local_ned_m=local, local_boot_ms=m.time_boot_ms)


def _attitude(state: VehicleState, m: Any, now_ns: int) -> VehicleState:
    quaternion = unit_quaternion(m.q1, m.q2, m.q3, m.q4)
    rates = (float(m.rollspeed), float(m.pitchspeed), float(m.yawspeed))
    if quaternion is None or not all(map(math.isfinite, rates)):
        return state
    return replaced(state, attitude_wxyz=quaternion, rates_rad_s=rates)


def unit_quaternion(w: float, x: float, y: float, z: float) -> Quaternion | None:
    """Return the normalised quaternion, None if it is no rotation (NaN, or its norm is off by over 10 %)."""
    norm = math.sqrt(w * w + x * x + y * y + z * z)
    if not 0.9 <= norm <= 1.1:  # also false for NaN
        return None
    return w / norm, x / norm, y / norm, z / norm


def _lla(lat_e7: int, lon_e7: int, alt_mm: int, *, zero: bool = False) -> Vector | None:
    """Return degrees and metres; None for 0, 0, which autopilots send before they have a position.

    zero: accept 0, 0 as a position.
    """
    off_earth = abs(lat_e7) > 900_000_000 or abs(lon_e7) > 1_800_000_000 or abs(alt_mm) > MOST_ALT_MM
    if (lat_e7 == 0 and lon_e7 == 0 and not zero) or off_earth:
        return None
    return lat_e7 * 1e-7, lon_e7 * 1e-7, alt_mm / 1000


_REDUCERS: dict[str, Callable[[VehicleState, Any, int], VehicleState]] = {
    "HEARTBEAT": _heartbeat,
    "CURRENT_MODE": _current_mode,
    "EXTENDED_SYS_STATE": _extended_sys_state,
    "PARAM_VALUE": _parameter,
    "SYS_STATUS": _sys_status,
    "BATTERY_STATUS": _battery_status,
    "HOME_POSITION": _home_position,
    "GLOBAL_POSITION_INT": _global_position,
    "LOCAL_POSITION_NED": _local_position,
    "ATTITUDE_QUATERNION": _attitude,
}
