"""Parameters of zones, sensor, link and rally points."""

from __future__ import annotations

from typing import Annotated, Literal

from params.mapping_parameters import MappingParameters
from params.spec import OURS, PAPER, THESIS, Spec, in_range


class SensorParameters(MappingParameters):
    """Parameters of zones, sensor, link and rally points."""

    # ---- identification and filtering -----------------------------------------------------------
    min_square_m: Annotated[
        float,
        in_range(0.1, 200),
        Spec("SLZ_SQUARE_M", "m", PAPER, "Side of the safe square a zone must hold."),
    ] = 3.0
    min_boundary_points: Annotated[
        int, in_range(1, 100000), Spec("SLZ_MIN_BOUND", "", THESIS, "Boundary points a zone must have.")
    ] = 40
    certainty_rule: Annotated[
        Literal["safe", "certain"],
        Spec("SLZ_CERT_RULE", "", "SLZ paper Eq. 16-17", "Cells counted as certain: safe or measured."),
    ] = "safe"
    confidence_factor: Annotated[
        float, in_range(0, 1), Spec("SLZ_CONF", "", PAPER, "Certainty from which a zone is drawn as certain.")
    ] = 0.86
    repeat_ratio: Annotated[
        float,
        in_range(0, 1),
        Spec("SLZ_REPEAT", "", PAPER, "Boundary share inside an old zone that repeats it."),
    ] = 0.8
    area_ratio: Annotated[
        float, in_range(0, 1), Spec("SLZ_AREA_RATIO", "", PAPER, "Least area ratio of a repeated zone.")
    ] = 0.9
    repeat_depth: Annotated[
        int,
        in_range(1, 100000),
        Spec("SLZ_REP_DEPTH", "", "SLZ paper §3.4.3", "Earlier zones that the repeat filter looks at."),
    ] = 1000
    touchdown_error_m: Annotated[
        float,
        in_range(0, 50),
        Spec("SLZ_TD_ERR_M", "m", OURS, "A landing point is safe when all cells this near to it are."),
    ] = 0.5
    surround_m: Annotated[
        float,
        in_range(1, 1000),
        Spec("SLZ_SURR_M", "m", OURS, "How far around a landing point obstacles are listed."),
    ] = 30.0
    approach_slope_deg: Annotated[
        float,
        in_range(3, 89),
        Spec("SLZ_APPR_SLOPE", "deg", OURS, "Least slope of a way in or out of a landing point."),
    ] = 30.0
    corridor_m: Annotated[
        float,
        in_range(1, 1000),
        Spec("SLZ_CORR_M", "m", OURS, "How far from a landing point its ways in and out are judged."),
    ] = 60.0
    corridor_margin_m: Annotated[
        float,
        in_range(0, 50),
        Spec("SLZ_CORR_MARG", "m", OURS, "Room beside the vehicle in a way in or out."),
    ] = 1.0
    vehicle_height_m: Annotated[
        float,
        in_range(0.1, 30),
        Spec("SLZ_VEH_H_M", "m", OURS, "Height of a way in or out: the vehicle and room above and below it."),
    ] = 2.0
    max_zones: Annotated[
        int, in_range(1, 10000), Spec("SLZ_MAX_ZONES", "", OURS, "Zones reported at most, best first.")
    ] = 64

    # ---- sensor ---------------------------------------------------------------------------------
    lidar_x_m: Annotated[
        float, in_range(-20, 20), Spec("SLZ_LDR_X_M", "m", OURS, "LiDAR position forward of the autopilot.")
    ] = 0.1
    lidar_y_m: Annotated[
        float, in_range(-20, 20), Spec("SLZ_LDR_Y_M", "m", OURS, "LiDAR position right of the autopilot.")
    ] = 0.0
    lidar_z_m: Annotated[
        float, in_range(-20, 20), Spec("SLZ_LDR_Z_M", "m", OURS, "LiDAR position below the autopilot.")
    ] = 0.1
    lidar_roll_deg: Annotated[
        float,
        in_range(-180, 180),
        Spec("SLZ_LDR_ROLL", "deg", OURS, "LiDAR boresight roll (docs/units_and_frames)."),
    ] = 0.0
    lidar_pitch_deg: Annotated[
        float, in_range(-180, 180), Spec("SLZ_LDR_PITCH", "deg", OURS, "LiDAR boresight pitch.")
    ] = 112.5
    lidar_yaw_deg: Annotated[
        float, in_range(-180, 180), Spec("SLZ_LDR_YAW", "deg", OURS, "LiDAR boresight yaw.")
    ] = 0.0
    lidar_min_m: Annotated[
        float,
        in_range(0, 100),
        Spec("SLZ_LDR_MIN_M", "m", OURS, "Nearer returns are the vehicle itself or dust."),
    ] = 0.6
    lidar_max_m: Annotated[
        float, in_range(1, 5000), Spec("SLZ_LDR_MAX_M", "m", OURS, "Farther returns are not used.")
    ] = 70.0
    vehicle_m: Annotated[
        float,
        in_range(0, 20),
        Spec(
            "SLZ_VEHICLE_M",
            "m",
            OURS,
            "Returns nearer to the autopilot are its vehicle; 0 drops none.",
        ),
    ] = 0.0
    dust_reach_m: Annotated[
        float,
        in_range(0, 100),
        Spec(
            "SLZ_DUST_R_M", "m", OURS, "Up to here weak returns and first ones of several are rain or dust."
        ),
    ] = 0.0
    dust_intensity: Annotated[
        int,
        in_range(0, 255),
        Spec("SLZ_DUST_I", "", OURS, "Weaker returns within dust_reach_m are rain or dust."),
    ] = 4
    lidar_timeout_s: Annotated[
        float,
        in_range(0.1, 30),
        Spec("SLZ_LDR_TOUT_S", "s", OURS, "Silence after which the LiDAR counts as lost."),
    ] = 1.0
    lidar_delay_ms: Annotated[
        float,
        in_range(-500, 500),
        Spec("SLZ_LDR_DLY_MS", "ms", OURS, "Fixed delay between measurement and arrival, taken off."),
    ] = 0.0
    lidar_clock: Annotated[
        Literal["free", "ptp", "gps"],
        Spec("SLZ_LDR_CLOCK", "", OURS, "What the LiDAR's clock follows; this computer must follow it too."),
    ] = "free"

    # ---- link -----------------------------------------------------------------------------------
    component_id: Annotated[
        int, in_range(1, 255), Spec("SLZ_COMPID", "", OURS, "MAVLink component number of this program.")
    ] = 191
    pose_rate_hz: Annotated[
        float, in_range(5, 200), Spec("SLZ_POSE_HZ", "Hz", OURS, "Attitude and position rate asked for.")
    ] = 50.0
    pose_timeout_s: Annotated[
        float, in_range(0.05, 10), Spec("SLZ_POSE_TOUT", "s", OURS, "Age beyond which a pose is stale.")
    ] = 0.5
    link_timeout_s: Annotated[
        float,
        in_range(1, 60),
        Spec("SLZ_LINK_TOUT", "s", OURS, "Silence after which the autopilot is lost.", live=True),
    ] = 5.0
    landing_target_hz: Annotated[
        float, in_range(3, 50), Spec("SLZ_TARGET_HZ", "Hz", OURS, "Rate of LANDING_TARGET.")
    ] = 20.0
    obstacle_hz: Annotated[
        float, in_range(1, 50), Spec("SLZ_OBST_HZ", "Hz", OURS, "Rate of OBSTACLE_DISTANCE.", live=True)
    ] = 12.0

    record_mb: Annotated[
        float,
        in_range(1, 1_000_000),
        Spec("SLZ_REC_MB", "MiB", OURS, "A recording grows to this size at most."),
    ] = 16384.0

    # ---- rally points ---------------------------------------------------------------------------
    rally: Annotated[
        Literal["off", "on"],
        Spec(
            "SLZ_RALLY",
            "",
            OURS,
            "Whether the best zones are given to the autopilot as rally points, to which its RTL flies.",
            live=True,
        ),
    ] = "off"
    rally_height_m: Annotated[
        float,
        in_range(3, 500),
        Spec("SLZ_RALLY_H", "m", OURS, "Height of a rally point above its ground.", live=True),
    ] = 20.0
