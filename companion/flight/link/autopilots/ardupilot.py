"""ArduPilot: ArduCopter, for multirotors and helicopters; ArduPlane is recognised and not commanded."""

from __future__ import annotations

import math
from collections.abc import Mapping

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from companion.flight.link.autopilots.autopilot_interface import (
    Autopilot,
    ExternalPosition,
    FenceLimits,
    FenceRules,
    LandingMode,
)
from companion.flight.link.vehicle_class import COPTER_TYPES, VTOL_STATES, VTOL_TYPES, type_name

# HEARTBEAT.custom_mode of ArduCopter (ardupilot.org/copter, parameter FLTMODE1).
MODES = {
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
CEILING, CIRCLE, AREAS, FLOOR = 1, 2, 4, 8  # bits of FENCE_TYPE
UNION = 2  # bit of FENCE_OPTIONS
# Its estimator looks back VISO_DELAY_MS, and no farther, and takes a measurement to be that much older than
# its stamp. So the stamp is later by this, and the message waits until that time: what would arrive earlier
# would be used no sooner, but a stamp of the future would spoil its estimate of our clock.
VISO_DELAY_NS = 200_000_000
MAVLINK_ODOMETRY, EXTERNAL_NAV = 1.0, 6.0  # of VISO_TYPE, and of a source's position


def _no_command_reason(vehicle_type: int, vtol_state: int | None, is_plane: bool) -> str:
    """ArduPlane takes no velocities and has other modes. ArduCopter reports a hovering VTOL, always."""
    if is_plane or vtol_state in VTOL_STATES or vehicle_type in VTOL_TYPES:
        return "ArduPlane"
    return "" if vehicle_type in COPTER_TYPES else type_name(vehicle_type)


def _fence_limits(values: Mapping[str, float], enabled: bool) -> FenceLimits | None:
    """Circle around home, ceiling and floor above it by parameters (AC_Fence.cpp); areas by items.

    Velocities of the guided mode stop at FENCE_MARGIN without a word (AC_Avoid.cpp), and nothing refuses
    them. A command or a switch may enable the fence, too.
    """
    if not (values["FENCE_ENABLE"] or values["FENCE_AUTOENABLE"] or enabled):
        return None
    kinds, margin_m = int(values["FENCE_TYPE"]), max(0.0, values["FENCE_MARGIN"])
    return FenceLimits(
        radius_m=values["FENCE_RADIUS"] if kinds & CIRCLE else math.inf,
        lowest_m=values["FENCE_ALT_MIN"] if kinds & FLOOR else -math.inf,
        highest_m=values["FENCE_ALT_MAX"] if kinds & CEILING else math.inf,
        margin_m=max(0.0, values["FENCE_MARGIN_XY"]) or margin_m,
        height_margin_m=margin_m,
        is_union=bool(int(values["FENCE_OPTIONS"]) & UNION),
        has_areas=bool(kinds & AREAS),
    )


ARDUPILOT = Autopilot(
    name="ardupilot",
    title="ArduPilot",
    firmware="ArduCopter",
    mav_autopilot=mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA,
    versions=((4, 5), (4, 7)),
    modes={name: (number, 0) for name, number in MODES.items()},
    mode_types=COPTER_TYPES,
    guided_mode="GUIDED",
    landing_mode="LAND",
    # The last part of each follows a target, and is reported (mode.cpp, land_run_horizontal_control).
    own_landings={
        "LAND": LandingMode(switch="PLND_ENABLED"),
        **dict.fromkeys(
            ("RTL", "SMART_RTL", "AUTO_RTL", "AUTO"), LandingMode(at_end=True, switch="PLND_ENABLED")
        ),
    },
    no_command_reason=_no_command_reason,
    plane_parameter="Q_ENABLE",  # of ArduPlane alone, whatever its value; Q_MAV_TYPE may pose as a multirotor
    parameter_file="arducopter.parm",
    odometry_file="arducopter_odometry.parm",
    fence=FenceRules(
        ("FENCE_ENABLE", "FENCE_TYPE", "FENCE_RADIUS", "FENCE_ALT_MAX", "FENCE_MARGIN"),
        {
            "FENCE_ALT_MIN": -math.inf,
            "FENCE_AUTOENABLE": 0.0,
            "FENCE_MARGIN_XY": 0.0,
            "FENCE_OPTIONS": 0.0,
            "FENCE_TOTAL": 0.0,
        },
        _fence_limits,
    ),
    # It reads LOCAL_FRD and BODY_FRD only (GCS_Common.cpp, handle_odometry) and fuses the position as one
    # relative to its local origin towards north, east and down, so its LOCAL_FRD must point north.
    external_position=ExternalPosition(
        mavlink.MAV_FRAME_LOCAL_FRD,
        mavlink.MAV_ESTIMATOR_TYPE_LIDAR,
        oldest_ns=VISO_DELAY_NS + 50_000_000,
        delay_ns=VISO_DELAY_NS,
        needs_clock=True,
    ),
    second_source={"VISO_TYPE": MAVLINK_ODOMETRY, "EK3_SRC2_POSXY": EXTERNAL_NAV},
    takes_obstacle_points=True,
    backs_off_ms=1.2,  # AVOID_BACKUP_SPD and AVOID_BACKZ_SPD, away from obstacles and fences
    obeys_reposition=True,
    reports_guided_points=True,
)
