"""Setpoints for guided modes (ArduPilot GUIDED, PX4 OFFBOARD)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from companion.flight.geometry.axes import Floats
from companion.flight.link.clock.message_order import boot_step_ms
from companion.flight.link.vehicle_state import VehicleState

# A position older than this is not where the vehicle is.
SIGNAL_MS = 500
_POSITION = (
    mavlink.POSITION_TARGET_TYPEMASK_X_IGNORE
    | mavlink.POSITION_TARGET_TYPEMASK_Y_IGNORE
    | mavlink.POSITION_TARGET_TYPEMASK_Z_IGNORE
)
_VELOCITY = (
    mavlink.POSITION_TARGET_TYPEMASK_VX_IGNORE
    | mavlink.POSITION_TARGET_TYPEMASK_VY_IGNORE
    | mavlink.POSITION_TARGET_TYPEMASK_VZ_IGNORE
)
_ACCELERATION = (
    mavlink.POSITION_TARGET_TYPEMASK_AX_IGNORE
    | mavlink.POSITION_TARGET_TYPEMASK_AY_IGNORE
    | mavlink.POSITION_TARGET_TYPEMASK_AZ_IGNORE
)
_YAW = mavlink.POSITION_TARGET_TYPEMASK_YAW_IGNORE
_YAW_RATE = mavlink.POSITION_TARGET_TYPEMASK_YAW_RATE_IGNORE


def velocity_setpoint(
    vehicle: VehicleState, velocity_enu_ms: Sequence[float] | Floats, yaw_rad: float | None = None
) -> Any:
    """Return a velocity setpoint (SET_POSITION_TARGET_LOCAL_NED).

    Parameters
    ----------
    vehicle
        Receiver.
    velocity_enu_ms
        East, north, up, m/s.
    yaw_rad
        Heading to turn to, clockwise from north; None keeps it (yaw rate zero).

    Raises
    ------
    ValueError
        A velocity or the heading is not finite: the vehicle must never receive that.
    """
    east, north, up = (float(value) for value in velocity_enu_ms)
    if not all(map(math.isfinite, (east, north, up, yaw_rad or 0.0))):
        raise ValueError(f"velocity setpoint {east}, {north}, {up} m/s, heading {yaw_rad} is not finite")
    mask = _POSITION | _ACCELERATION | (_YAW if yaw_rad is None else _YAW_RATE)
    return mavlink.MAVLink_set_position_target_local_ned_message(
        vehicle.boot_ms or 0,
        vehicle.sysid or 0,
        mavlink.MAV_COMP_ID_AUTOPILOT1,
        mavlink.MAV_FRAME_LOCAL_NED,
        mask,
        *(0.0, 0.0, 0.0),
        *(north, east, -up),
        *(0.0, 0.0, 0.0),
        0.0 if yaw_rad is None else math.remainder(yaw_rad, 2 * math.pi),
        0.0,
    )


def offboard_signal(vehicle: VehicleState) -> Any | None:
    """Return the setpoint that lets PX4 enter OFFBOARD, None without a fresh local position.

    PX4 refuses OFFBOARD unless setpoints arrive, at more than 1 Hz, with a position, velocity or acceleration
    that is not ignored (all ignored is an error, an attitude would take its height control away). In OFFBOARD
    the setpoint is zero velocity. In every other mode it is the present position with velocities and
    accelerations ignored: a version that mixes a companion's velocities into the pilot's modes finds none.
    """
    if vehicle.guided:
        return hold_setpoint(vehicle)
    local, boot_ms = vehicle.local_ned_m, vehicle.boot_ms
    if local is None or boot_ms is None or boot_step_ms(vehicle.local_boot_ms, boot_ms) > SIGNAL_MS:
        return None
    return mavlink.MAVLink_set_position_target_local_ned_message(
        boot_ms,
        vehicle.sysid or 0,
        mavlink.MAV_COMP_ID_AUTOPILOT1,
        mavlink.MAV_FRAME_LOCAL_NED,
        _VELOCITY | _ACCELERATION | _YAW,
        *local,
        *(0.0, 0.0, 0.0),
        *(0.0, 0.0, 0.0),
        0.0,
        0.0,
    )


def hold_setpoint(vehicle: VehicleState) -> Any:
    """Return a setpoint of zero velocity."""
    return velocity_setpoint(vehicle, (0.0, 0.0, 0.0))
