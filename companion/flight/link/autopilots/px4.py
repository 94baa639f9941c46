"""PX4: multirotors, helicopters, and VTOLs while they hover."""

from __future__ import annotations

import math
from collections.abc import Mapping

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from companion.flight.link.autopilots.autopilot_interface import (
    STICKS,
    Autopilot,
    ExternalPosition,
    FenceLimits,
    FenceRules,
    LandingMode,
    Stream,
)
from companion.flight.link.vehicle_class import (
    NO_VTOL,
    ROTARY_WINGS,
    VTOL_HOVERS,
    VTOL_STATES,
    VTOL_TYPES,
    type_name,
)
from companion.flight.link.wire.current_mode import CURRENT_MODE

# Main and sub modes (px4_custom_mode.h).
MODES = {
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
# The mode comes on change, and otherwise at this rate, whatever was requested; the heartbeat has a rate of
# its own.
MODE_HZ = 2.0


def _unpack_mode(custom_mode: int) -> tuple[int, int]:
    """HEARTBEAT.custom_mode is main << 16 | sub << 24."""
    return (custom_mode >> 16) & 0xFF, custom_mode >> 24


def _no_command_reason(vehicle_type: int, vtol_state: int | None, is_plane: bool) -> str:
    """A VTOL on its wing goes straight on at cruise speed in OFFBOARD, and sinks."""
    is_vtol = vtol_state not in (None, NO_VTOL)
    if not is_vtol and vehicle_type not in VTOL_TYPES:
        return "" if vehicle_type in ROTARY_WINGS else type_name(vehicle_type)
    if vtol_state == VTOL_HOVERS:
        return ""
    return VTOL_STATES.get(NO_VTOL if vtol_state is None else vtol_state, "VTOL state unknown")


def _fence_limits(values: Mapping[str, float], enabled: bool) -> FenceLimits | None:
    """Distances from home by parameters (geofence.cpp), areas by items; GF_ACTION takes the mode there."""
    if values["GF_ACTION"] == 0:
        return None
    radius_m, highest_m = values["GF_MAX_HOR_DIST"], values["GF_MAX_VER_DIST"]
    return FenceLimits(
        radius_m=radius_m if radius_m > 0 else math.inf,
        highest_m=highest_m if highest_m > 0 else math.inf,
    )


PX4 = Autopilot(
    name="px4",
    title="PX4",
    firmware="PX4",
    mav_autopilot=mavlink.MAV_AUTOPILOT_PX4,
    versions=((1, 14), (1, 18)),
    modes=MODES,
    unpack_mode=_unpack_mode,
    guided_mode="OFFBOARD",
    landing_mode="AUTO.PRECLAND",
    # RTL follows one with RTL_PLD_MD, a mission's NAV_LAND with param2 (rtl_direct.cpp, mission_base.cpp).
    own_landings={
        "AUTO.LAND": LandingMode(follows_target=False),
        "AUTO.PRECLAND": LandingMode(),
        "AUTO.RTL": LandingMode(at_end=True, switch="RTL_PLD_MD"),
        "AUTO.MISSION": LandingMode(at_end=True),
    },
    no_command_reason=_no_command_reason,
    mode_stream=Stream("CURRENT_MODE", CURRENT_MODE, 5.0, needed=False, steady_hz=MODE_HZ),
    own_streams=(
        Stream("ESTIMATOR_STATUS", mavlink.MAVLINK_MSG_ID_ESTIMATOR_STATUS, 5.0, needed=False),
        Stream("MANUAL_CONTROL", mavlink.MAVLINK_MSG_ID_MANUAL_CONTROL, 5.0, needed=False),
        STICKS,
        Stream("WIND_COV", mavlink.MAVLINK_MSG_ID_WIND_COV, 2.0, needed=False),
    ),
    overtaken_ns=200_000_000,
    wind_heading_is_towards=True,  # HIGH_LATENCY2.hpp
    bytewise_parameters=True,
    parameter_file="px4.params",
    odometry_file="px4_odometry.params",
    fence=FenceRules(("GF_ACTION", "GF_MAX_HOR_DIST", "GF_MAX_VER_DIST"), {}, _fence_limits),
    landing_target_frame=mavlink.MAV_FRAME_LOCAL_NED,
    open_signal_ns=200_000_000,  # OFFBOARD needs more than 1 Hz, see `offboard_signal`
    # It reads LOCAL_NED, and refuses MAV_ESTIMATOR_TYPE_LIDAR with a critical text for each message
    # (mavlink_receiver.cpp). It fuses a sample at its own time and looks back 0.3 s (EKF2_DELAY_MAX).
    external_position=ExternalPosition(
        mavlink.MAV_FRAME_LOCAL_NED, mavlink.MAV_ESTIMATOR_TYPE_VISION, oldest_ns=300_000_000
    ),
)
