"""Vehicle classes: types and states of flight in which a vehicle may be commanded, or not.

Velocities, the landing mode and a landing target fly a multirotor or helicopter. A fixed wing, and a VTOL in
fixed-wing flight, ignore them or fly on. Ground and water vehicles, and types that are unknown, are not
commanded either. Each autopilot has a rule of its own, `no_command_reason`, over the classes of this file.
"""

from __future__ import annotations

from pymavlink.dialects.v20 import ardupilotmega as mavlink

# MAV_TYPE of everything that runs ArduCopter: multirotors, coaxial and single-rotor helicopters.
COPTER_TYPES = frozenset({2, 3, 4, 13, 14, 15, 29, 35})
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
NO_VTOL: int = mavlink.MAV_VTOL_STATE_UNDEFINED
VTOL_HOVERS: int = mavlink.MAV_VTOL_STATE_MC
VTOL_UNHEARD = -1  # state of a VTOL that was heard too long ago
VTOL_STATES = {
    mavlink.MAV_VTOL_STATE_TRANSITION_TO_FW: "VTOL in transition",
    mavlink.MAV_VTOL_STATE_TRANSITION_TO_MC: "VTOL in transition",
    mavlink.MAV_VTOL_STATE_FW: "VTOL in fixed-wing flight",
}


def type_name(vehicle_type: int) -> str:
    """Return the name of a MAV_TYPE in words, or its number if the dialect has no name."""
    if vehicle_type in VTOL_NAMES:
        return VTOL_NAMES[vehicle_type]
    entry = mavlink.enums["MAV_TYPE"].get(vehicle_type)
    name = "" if entry is None else str(entry.name)
    return name.removeprefix("MAV_TYPE_").replace("_", " ").lower() or f"type {vehicle_type}"
