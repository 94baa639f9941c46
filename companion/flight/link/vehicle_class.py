"""Vehicle class: whether a vehicle of this type, in its present state of flight, may be commanded.

Velocities, the landing mode and a landing target fly a multirotor or helicopter. A fixed wing, and a VTOL in
fixed-wing flight, ignore them or fly on: PX4 goes straight on at cruise speed in OFFBOARD and sinks. Ground
and water vehicles, and types that are unknown, are not commanded either.
"""

from __future__ import annotations

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from companion.flight.link.flight_modes import COPTER_TYPES, Autopilot

GENERIC_MULTIROTOR = 43  # MAV_TYPE, newer than the dialect
# Names of MAVLink's newer definition; the dialect calls some of them reserved.
VTOL_NAMES = {
    19: "tailsitter VTOL",
    20: "tailsitter VTOL",
    21: "tiltrotor VTOL",
    22: "fixed-rotor VTOL",
    23: "tailsitter VTOL",
    24: "tiltwing VTOL",
    25: "VTOL",
}
VTOL_TYPES = frozenset(VTOL_NAMES)
ROTARY_WINGS = COPTER_TYPES | {GENERIC_MULTIROTOR}
PLANE_PARAMETER = "Q_ENABLE"  # of ArduPlane alone, whatever its value; Q_MAV_TYPE may pose as a multirotor
NO_VTOL: int = mavlink.MAV_VTOL_STATE_UNDEFINED
VTOL_HOVERS: int = mavlink.MAV_VTOL_STATE_MC
VTOL_UNHEARD = -1  # state of a VTOL that was heard too long ago
VTOL_STATES = {
    mavlink.MAV_VTOL_STATE_TRANSITION_TO_FW: "VTOL in transition",
    mavlink.MAV_VTOL_STATE_TRANSITION_TO_MC: "VTOL in transition",
    mavlink.MAV_VTOL_STATE_FW: "VTOL in fixed-wing flight",
}


def no_command_reason(
    autopilot: Autopilot, vehicle_type: int, vtol_state: int | None, *, is_plane: bool = False
) -> str:
    """Return why the vehicle must not be commanded, "" if it may.

    Parameters
    ----------
    vehicle_type
        MAV_TYPE of the heartbeat. Both autopilots let their user set it, so a state of a VTOL counts more.
    vtol_state
        MAV_VTOL_STATE of EXTENDED_SYS_STATE, or `VTOL_UNHEARD`; None before the first.
    is_plane
        Whether the autopilot has `PLANE_PARAMETER`.
    """
    if autopilot == "ardupilot":
        # ArduPlane takes no velocities and has other modes. ArduCopter reports a hovering VTOL, always.
        if is_plane or vtol_state in VTOL_STATES or vehicle_type in VTOL_TYPES:
            return "ArduPlane"
        return "" if vehicle_type in COPTER_TYPES else type_name(vehicle_type)
    if autopilot != "px4":  # its modes and what it does with a setpoint are unknown
        return "unknown autopilot"
    is_vtol = vtol_state not in (None, NO_VTOL)
    if not is_vtol and vehicle_type not in VTOL_TYPES:
        return "" if vehicle_type in ROTARY_WINGS else type_name(vehicle_type)
    if vtol_state == VTOL_HOVERS:
        return ""
    return VTOL_STATES.get(NO_VTOL if vtol_state is None else vtol_state, "VTOL state unknown")


def type_name(vehicle_type: int) -> str:
    """Return the name of a MAV_TYPE in words, or its number if the dialect has no name."""
    if vehicle_type in VTOL_NAMES:
        return VTOL_NAMES[vehicle_type]
    entry = mavlink.enums["MAV_TYPE"].get(vehicle_type)
    name = "" if entry is None else str(entry.name)
    return name.removeprefix("MAV_TYPE_").replace("_", " ").lower() or f"type {vehicle_type}"
