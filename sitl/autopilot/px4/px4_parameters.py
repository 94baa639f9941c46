"""Parameters of PX4: names, units and defaults of its multicopters, set up for a companion.

Integers and floats are different types on the wire. What the shared parts read besides (names of ArduCopter)
is in the same dictionary, but PX4 has no such parameters: the wire shows `TYPES` alone.
"""

from __future__ import annotations

import math
import struct
from collections.abc import Iterator, Mapping

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from sitl.autopilot.aiding import ekf2_odometry, external_navigation, source_sets

REAL32, INT32 = mavlink.MAV_PARAM_TYPE_REAL32, mavlink.MAV_PARAM_TYPE_INT32

FLOATS: dict[str, float] = {
    **{
        name: value
        for name, value in ekf2_odometry.DEFAULTS.items()
        if "_CTRL" not in name and "_EN" not in name
    },
    "BAT1_CAPACITY": 5200,  # mAh
    "BAT1_V_CHARGED": 4.2,  # V a cell
    "BAT1_V_EMPTY": 3.5,
    "BAT_CRIT_THR": 0.07,
    "BAT_EMERGEN_THR": 0.05,
    "BAT_LOW_THR": 0.15,
    "COM_DISARM_LAND": 2.0,  # s
    "COM_DISARM_PRFLT": 10.0,
    "COM_FAIL_ACT_T": 5.0,  # s of Hold before a failsafe's action
    "COM_OF_LOSS_T": 1.0,
    "COM_RC_LOSS_T": 0.5,
    "COM_RC_STICK_OV": 30.0,  # % per second
    "GF_MAX_HOR_DIST": 0.0,
    "GF_MAX_VER_DIST": 0.0,
    "LNDMC_TRIG_TIME": 1.0,
    "MIS_TAKEOFF_ALT": 2.5,
    "MPC_ACC_DOWN_MAX": 3.0,
    "MPC_ACC_HOR": 3.0,
    "MPC_ACC_UP_MAX": 4.0,
    "MPC_LAND_ALT1": 10.0,
    "MPC_LAND_ALT2": 5.0,
    "MPC_LAND_ALT3": 1.0,
    "MPC_LAND_CRWL": 0.3,
    "MPC_LAND_SPEED": 0.7,
    "MPC_TKO_SPEED": 1.5,
    "MPC_VEL_MANUAL": 10.0,
    "MPC_XY_CRUISE": 5.0,
    "MPC_XY_P": 0.95,
    "MPC_XY_VEL_MAX": 12.0,
    "MPC_Z_P": 1.0,
    "MPC_Z_VEL_MAX_DN": 1.5,
    "MPC_Z_VEL_MAX_UP": 3.0,
    "MPC_Z_V_AUTO_DN": 1.5,
    "MPC_Z_V_AUTO_UP": 3.0,
    "NAV_ACC_RAD": 2.0,  # rc.mc_defaults
    "NAV_MC_ALT_RAD": 0.8,
    "PLD_BTOUT": 5.0,
    "PLD_FAPPR_ALT": 1.5,  # set up; default 0.1
    "PLD_HACC_RAD": 0.2,
    "PLD_SRCH_ALT": 10.0,
    "PLD_SRCH_TOUT": 10.0,
    "RTL_DESCEND_ALT": 10.0,  # rc.mc_defaults
    "RTL_LAND_DELAY": 0.0,  # s, below 0 does not land
    "RTL_MIN_DIST": 10.0,
    "RTL_RETURN_ALT": 30.0,  # rc.mc_defaults
}
INTEGERS: dict[str, float] = {
    "BAT1_N_CELLS": 4,
    "COM_DLL_EXCEPT": 0,  # bits: 1 mission, 2 Hold, 4 OFFBOARD
    "COM_DL_LOSS_T": 10,  # s
    "COM_LOW_BAT_ACT": 0,  # 0 warns, 2 lands, 3 returns when critical and lands in an emergency
    "COM_OBL_RC_ACT": 5,  # set up: Hold; default 0, Position mode
    "COM_RCL_EXCEPT": 0,
    "COM_RC_IN_MODE": 3,  # 4 is without sticks
    "COM_RC_OVERRIDE": 3,  # set up: in OFFBOARD, too; default 1
    "EKF2_EN": 1,
    "EKF2_EV_CTRL": 0,  # set up; default 15
    "EKF2_HGT_REF": 1,
    "GF_ACTION": 2,  # 1 warns, 2 holds, 3 returns, 4 terminates, 5 lands
    "GF_PREDICT": 0,
    "GF_SOURCE": 0,
    "MAV_SYS_ID": 1,
    "MAV_TYPE": 2,
    "MPC_LAND_RC_HELP": 0,
    "NAV_DLL_ACT": 0,  # 1 holds, 2 returns, 3 lands, 5 terminates, 6 disarms
    "NAV_RCL_ACT": 2,
    "PLD_MAX_SRCH": 3,
    "RTL_CONE_ANG": 45,  # degrees
    "RTL_PLD_MD": 1,  # set up: when a target is seen; 2 searches; default 0
    "RTL_TYPE": 0,
}
TYPES: dict[str, int] = dict.fromkeys(FLOATS, REAL32) | dict.fromkeys(INTEGERS, INT32)
# What the shared parts read; GPS2_TYPE is whether there is a second receiver.
_SHARED: dict[str, float] = {
    **source_sets.DEFAULTS,
    **external_navigation.DEFAULTS,
    "GPS2_TYPE": 0,
    "PRX1_ORIENT": 0,
    "PRX1_YAW_CORR": 0,
    "RNGFND1_ORIENT": 25,
    "SYSID_MYGCS": 255,
    "FENCE_TOTAL": 0,
    "RALLY_TOTAL": 0,
    "MIS_TOTAL": 0,
}


def px4_defaults(parameters: dict[str, float]) -> dict[str, float]:
    """Return parameters with PX4's defaults."""
    return _SHARED | FLOATS | INTEGERS | parameters


def is_settable(name: str, value: float) -> bool:
    """Return whether a value may be set: PX4 itself checks nothing but the type."""
    return name in TYPES and math.isfinite(value) and abs(value) < 2**31


def to_wire(name: str, value: float) -> float:
    """Return a value as PARAM_VALUE's float: an integer by its bytes."""
    if TYPES[name] == REAL32:
        return value
    return float(struct.unpack("<f", struct.pack("<i", int(value)))[0])


def from_wire(name: str, value: float, kind: int) -> float | None:
    """Return the value of a PARAM_SET; None for another type than the parameter's."""
    if kind != TYPES[name]:
        return None
    return value if kind == REAL32 else float(struct.unpack("<i", struct.pack("<f", value))[0])


class SharedLimits(Mapping[str, float]):
    """Speeds and accelerations of PX4 by ArduCopter's names and units, for the shared shaping."""

    _names: Mapping[str, str] = {
        "WPNAV_SPEED": "MPC_XY_CRUISE",
        "WPNAV_SPEED_UP": "MPC_Z_V_AUTO_UP",
        "WPNAV_SPEED_DN": "MPC_Z_V_AUTO_DN",
        "WPNAV_ACCEL": "MPC_ACC_HOR",
        "LOIT_SPEED": "MPC_VEL_MANUAL",
        "PILOT_SPEED_UP": "MPC_Z_VEL_MAX_UP",
    }

    def __init__(self, parameters: Mapping[str, float]) -> None:
        self._parameters = parameters

    def __getitem__(self, name: str) -> float:
        return 100 * self._parameters[self._names[name]]

    def __iter__(self) -> Iterator[str]:
        return iter(self._names)

    def __len__(self) -> int:
        return len(self._names)
