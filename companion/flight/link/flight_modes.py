"""Flight mode names and their numbers in each autopilot.

Numbers: ArduCopter's mode table (ardupilot.org/copter, parameter FLTMODE1); PX4's main and sub modes
(px4_custom_mode.h), packed into HEARTBEAT.custom_mode as main << 16 | sub << 24.
"""

from __future__ import annotations

from typing import Literal

Autopilot = Literal["unknown", "ardupilot", "px4", "other"]

ARDUCOPTER = {
    "STABILIZE": 0,
    "ACRO": 1,
    "ALT_HOLD": 2,
    "AUTO": 3,
    "GUIDED": 4,
    "LOITER": 5,
    "RTL": 6,
    "CIRCLE": 7,
    "LAND": 9,
    "DRIFT": 11,
    "SPORT": 13,
    "FLIP": 14,
    "AUTOTUNE": 15,
    "POSHOLD": 16,
    "BRAKE": 17,
    "THROW": 18,
    "AVOID_ADSB": 19,
    "GUIDED_NOGPS": 20,
    "SMART_RTL": 21,
    "FLOWHOLD": 22,
    "FOLLOW": 23,
    "ZIGZAG": 24,
    "SYSTEMID": 25,
    "AUTOROTATE": 26,
    "AUTO_RTL": 27,
    "TURTLE": 28,
}
PX4 = {
    "MANUAL": (1, 0),
    "ALTCTL": (2, 0),
    "POSCTL": (3, 0),
    "POSCTL.ORBIT": (3, 1),
    "POSCTL.SLOW": (3, 2),
    "AUTO.READY": (4, 1),
    "AUTO.TAKEOFF": (4, 2),
    "AUTO.LOITER": (4, 3),
    "AUTO.MISSION": (4, 4),
    "AUTO.RTL": (4, 5),
    "AUTO.LAND": (4, 6),
    "AUTO.FOLLOW_TARGET": (4, 8),
    "AUTO.PRECLAND": (4, 9),
    "AUTO.VTOL_TAKEOFF": (4, 10),
    "ACRO": (5, 0),
    "OFFBOARD": (6, 0),
    "STABILIZED": (7, 0),
    "TERMINATION": (10, 0),
}
_ARDUCOPTER_NAMES = {number: name for name, number in ARDUCOPTER.items()}
_PX4_NAMES = {pair: name for name, pair in PX4.items()}

# MAV_TYPE of everything that runs ArduCopter: multirotors, coaxial and single-rotor helicopters.
COPTER_TYPES = frozenset({2, 3, 4, 13, 14, 15, 29, 35})

GUIDED: dict[str, str] = {"ardupilot": "GUIDED", "px4": "OFFBOARD"}
PRECISION_LANDING: dict[str, str] = {"ardupilot": "LAND", "px4": "AUTO.PRECLAND"}


def mode_name(autopilot: Autopilot, vehicle_type: int, custom_mode: int) -> str:
    """Return the name of a mode; `MODE(n)` if it is unknown here."""
    name = None
    if autopilot == "ardupilot" and vehicle_type in COPTER_TYPES:
        name = _ARDUCOPTER_NAMES.get(custom_mode)
    elif autopilot == "px4":
        name = _PX4_NAMES.get(((custom_mode >> 16) & 0xFF, custom_mode >> 24))
    return name or f"MODE({custom_mode})"


def mode_parameters(autopilot: Autopilot, vehicle_type: int, name: str) -> tuple[float, float] | None:
    """Return parameters 2 and 3 of MAV_CMD_DO_SET_MODE for a mode, None if it is unknown."""
    if autopilot == "ardupilot" and vehicle_type in COPTER_TYPES and name in ARDUCOPTER:
        return float(ARDUCOPTER[name]), 0.0
    if autopilot == "px4" and name in PX4:
        main, sub = PX4[name]
        return float(main), float(sub)
    return None
