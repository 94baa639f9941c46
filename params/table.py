"""Table of all parameters.

A parameter is a field of `Parameters`: its Python name contains the unit; the `Spec` beside its type holds
the MAVLink name, unit, source and one sentence. Validation, profiles, command line, parameter server and
documentation all read this table. A value outside its range is refused, never clamped.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Annotated, Any, Literal, Self

from pydantic import BaseModel, ConfigDict, Field, field_validator, model_validator

PAPER = "SLZ paper Table 4"
THESIS = "SLZ thesis Table 3"
OURS = "this project"
GEAR_SHARES = {"pads": (0.285, 0.285), "skids": (0.6, 0.44), "tripod": (0.6, 0.44)}  # of the footprint
LEAST_GEAR_M = 0.1
CELLS_AT_MOST = (
    ("surround_m", 1000),
    ("footprint_m", 100),
    ("coverage_m", 100),
    ("rotor_diameter_m", 400),
    ("tail_length_m", 200),
    ("d_value_m", 400),
)
# Why a value must not fly, as a predicate of the value.
SOURCE_MODE = "calls unsafe ground safe: the paper's rules to the letter, for surveys only"
ODOMETRY_TO_AUTOPILOT = (
    "led a vehicle away: an unobserved axis counts as observed, and the autopilot's estimate of what it is"
    " sent confirms itself"
)
TILT_OVER_SLOPE_DEG = 5.0  # by which a landed vehicle may tilt more than the ground slopes


@dataclass(frozen=True, slots=True)
class Spec:
    """Metadata of a parameter besides its type, range and default.

    live: a change takes effect at once; otherwise at the next start.
    grounded: choices that must not fly, each with the reason (`params.grounded`).
    """

    mavlink: str
    unit: str
    source: str
    sentence: str
    live: bool = False
    grounded: Mapping[str, str] = field(default_factory=dict)


def _in(low: float, high: float) -> Any:
    return Field(ge=low, le=high)


class Parameters(BaseModel):
    """Immutable, validated set of all parameters (`params.load` builds one from a profile)."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False, validate_default=True)

    # ---- pre-processing -------------------------------------------------------------------------
    window_s: Annotated[
        float,
        _in(0.05, 10),
        Spec(
            "SLZ_WINDOW_S",
            "s",
            PAPER,
            "Time span of returns judged together; a window in flight is a tenth, longer on slow computers.",
        ),
    ] = 1.0
    zone_m: Annotated[
        float, _in(20, 20000), Spec("SLZ_ZONE_M", "m", THESIS, "Side of the square map around its origin.")
    ] = 400.0
    max_range_m: Annotated[
        float,
        _in(1, 5000),
        Spec("SLZ_MAXRANGE_M", "m", THESIS, "Points farther than this from the vehicle are not mapped."),
    ] = 100.0

    # ---- terrain models -------------------------------------------------------------------------
    mode: Annotated[
        Literal["default", "source"],
        Spec(
            "SLZ_MODE",
            "",
            OURS,
            "'source' runs the paper's rules to the letter, unsafe ones included.",
            grounded={"source": SOURCE_MODE},
        ),
    ] = "default"
    cell_m: Annotated[
        float, _in(0.05, 50), Spec("SLZ_CELL_M", "m", THESIS, "Side of a cell of the near map.")
    ] = 0.2
    far_cell_m: Annotated[
        float, _in(0.5, 100), Spec("SLZ_FAR_CELL_M", "m", THESIS, "Side of a cell of the far map.")
    ] = 2.0
    far_height_m: Annotated[
        float,
        _in(1, 10000),
        Spec("SLZ_FAR_H_M", "m", OURS, "Height over ground above which far mode is active."),
    ] = 40.0
    far_speed_ms: Annotated[
        float, _in(1, 500), Spec("SLZ_FAR_SPD", "m/s", OURS, "Ground speed above which far mode is active.")
    ] = 12.0
    adaptive: Annotated[
        Literal["on", "off"],
        Spec(
            "SLZ_ADAPTIVE",
            "",
            OURS,
            "Whether window and cells follow density, height and speed (default mode).",
        ),
    ] = "on"
    memory_mb: Annotated[
        float,
        _in(16, 32_768),
        Spec("SLZ_MEMORY_MB", "MiB", OURS, "Most memory for evidence of the ground (default mode)."),
    ] = 512.0
    histogram_bins: Annotated[
        int, _in(10, 10000), Spec("SLZ_HIST_BINS", "", THESIS, "Bins of the vertical outlier histogram.")
    ] = 300
    histogram_threshold: Annotated[
        float,
        _in(0.5, 1),
        Spec("SLZ_HIST_THR", "", THESIS, "Least share of points the outlier filter must keep."),
    ] = 0.9
    outlier_gap_m: Annotated[
        float,
        _in(0.5, 1000),
        Spec(
            "SLZ_OUTL_GAP_M",
            "m",
            OURS,
            "Empty vertical gap that sets a few points apart as outliers (default mode).",
        ),
    ] = 5.0
    worst_slope_deg: Annotated[
        float,
        _in(5, 90),
        Spec(
            "SLZ_WORST_SLOPE",
            "deg",
            PAPER,
            "Slope of unseen ground in source mode, which writes only slopes below it.",
        ),
    ] = 40.0
    safe_slope_deg: Annotated[
        float, _in(0.5, 45), Spec("SLZ_SAFE_SLOPE", "deg", PAPER, "A safe cell slopes less than this.")
    ] = 10.0
    fusing: Annotated[
        Literal["mean", "max"],
        Spec("SLZ_FUSING", "", PAPER, "How source mode joins a cell's old and new values."),
    ] = "mean"
    footprint_m: Annotated[
        float,
        _in(0.1, 50),
        Spec("SLZ_FOOTPRINT_M", "m", OURS, "Side of the square of ground under the landed vehicle."),
    ] = 2.0
    relief_m: Annotated[
        float,
        _in(0.02, 5),
        Spec(
            "SLZ_RELIEF_M",
            "m",
            OURS,
            "Height from the lowest to the highest ground about the footprint's plane that is a hazard.",
        ),
    ] = 0.3
    hazard_size_m: Annotated[
        float,
        _in(0.05, 5),
        Spec("SLZ_HAZARD_M", "m", OURS, "Side of the smallest hazard that a survey must not miss."),
    ] = 0.3
    gear: Annotated[
        Literal["pads", "skids", "tripod", "none"],
        Spec(
            "SLZ_GEAR",
            "",
            OURS,
            "Landing gear: four pads, two skids, one pad before two; 'none' leaves slope and relief alone.",
        ),
    ] = "pads"
    gear_length_m: Annotated[
        float,
        _in(0, 30),
        Spec(
            "SLZ_GEAR_L_M",
            "m",
            OURS,
            "Front to rear pads, or length of the skids; 0 is 0.285 footprint_m, of skids or a tripod 0.6.",
        ),
    ] = 0.0
    gear_width_m: Annotated[
        float,
        _in(0, 30),
        Spec(
            "SLZ_GEAR_W_M",
            "m",
            OURS,
            "Left to right pads or skids; 0 is 0.285 footprint_m, of skids or a tripod 0.44.",
        ),
    ] = 0.0
    pad_radius_m: Annotated[
        float, _in(0.005, 2), Spec("SLZ_PAD_R_M", "m", OURS, "Radius of a pad, or half the width of a skid.")
    ] = 0.03
    clearance_m: Annotated[
        float,
        _in(0.02, 10),
        Spec("SLZ_CLEAR_M", "m", OURS, "Height of the belly over the plane on which the gear rests."),
    ] = 0.3
    tip_limit_deg: Annotated[
        float,
        _in(0, 80),
        Spec(
            "SLZ_TIP_LIM",
            "deg",
            OURS,
            "The landed vehicle must tilt less than this; 0 is 5 degrees more than safe_slope_deg.",
        ),
    ] = 0.0
    rotor_diameter_m: Annotated[
        float,
        _in(0, 60),
        Spec(
            "SLZ_ROTOR_D_M",
            "m",
            OURS,
            "Main rotor disc, or circle around all propellers; 0 judges no disc.",
        ),
    ] = 0.0
    rotor_height_m: Annotated[
        float,
        _in(0, 30),
        Spec("SLZ_ROTOR_H_M", "m", OURS, "Height of that disc over the plane on which the gear rests."),
    ] = 0.0
    rotor_clearance_m: Annotated[
        float,
        _in(0.02, 10),
        Spec("SLZ_ROTOR_CLR", "m", OURS, "Least distance of obstacles from disc and tail, all around."),
    ] = 0.3
    tail_length_m: Annotated[
        float,
        _in(0, 60),
        Spec(
            "SLZ_TAIL_L_M", "m", OURS, "From the centre of gravity to the end of the tail; 0 judges no tail."
        ),
    ] = 0.0
    tail_width_m: Annotated[
        float, _in(0.05, 20), Spec("SLZ_TAIL_W_M", "m", OURS, "Width of the tail at its widest.")
    ] = 0.5
    tail_height_m: Annotated[
        float,
        _in(0, 30),
        Spec(
            "SLZ_TAIL_H_M",
            "m",
            OURS,
            "Height of the tail's lowest part, its rotor or guard, over the plane on which the gear rests.",
        ),
    ] = 0.0
    d_value_m: Annotated[
        float,
        _in(0, 100),
        Spec(
            "SLZ_D_VALUE_M",
            "m",
            OURS,
            "D: greatest dimension with rotors turning; 0 is that of disc and tail, without these none.",
        ),
    ] = 0.0
    water_suspicion: Annotated[
        float,
        _in(0, 1),
        Spec("SLZ_WATER", "", OURS, "Ground that is water with more than this probability is never safe."),
    ] = 0.05
    roof: Annotated[
        Literal["allow", "confirm", "refuse"],
        Spec(
            "SLZ_ROOF", "", OURS, "Zones on roofs: as any other, only when the operator confirms, or never."
        ),
    ] = "confirm"
    vegetation: Annotated[
        Literal["allow", "confirm", "refuse"],
        Spec("SLZ_VEGET", "", OURS, "Zones on crops, reeds and the like: as for roofs."),
    ] = "confirm"
    coverage_m: Annotated[
        float,
        _in(0.1, 50),
        Spec("SLZ_COVER_M", "m", OURS, "Unseen gaps at least this wide make ground unknown."),
    ] = 1.0
    range_noise_m: Annotated[
        float, _in(0, 1), Spec("SLZ_NOISE_M", "m", OURS, "Standard deviation of one return along its ray.")
    ] = 0.02
    angle_noise_deg: Annotated[
        float, _in(0, 5), Spec("SLZ_ANGLE_NOISE", "deg", OURS, "Standard deviation of a ray's direction.")
    ] = 0.15
    height_noise_m: Annotated[
        float,
        _in(0.01, 5),
        Spec("SLZ_HEIGHT_NOISE", "m", OURS, "Returns whose height is less certain than this are not mapped."),
    ] = 0.045
    register_m: Annotated[
        float,
        _in(0, 5),
        Spec(
            "SLZ_REGISTER",
            "m",
            OURS,
            "Greatest drift in height from one window to the next that the map follows; 0 follows none.",
        ),
    ] = 0.5
    odometry: Annotated[
        Literal["off", "map", "autopilot"],
        Spec(
            "SLZ_ODOMETRY",
            "",
            OURS,
            "Use of the LiDAR's or --ros2-odometry's position: none, map and landing, or autopilot too.",
            grounded={"autopilot": ODOMETRY_TO_AUTOPILOT},
        ),
    ] = "off"
    hold_s: Annotated[
        float,
        _in(0.5, 600),
        Spec("SLZ_HOLD_S", "s", OURS, "A hazard seen is kept at least this long against newer returns."),
    ] = 8.0
    max_age_s: Annotated[
        float,
        _in(1, 86400),
        Spec("SLZ_MAX_AGE_S", "s", OURS, "Ground not seen for longer counts as unknown."),
    ] = 300.0

    # ---- identification and filtering -----------------------------------------------------------
    min_square_m: Annotated[
        float, _in(0.1, 200), Spec("SLZ_SQUARE_M", "m", PAPER, "Side of the safe square a zone must hold.")
    ] = 3.0
    min_boundary_points: Annotated[
        int, _in(1, 100000), Spec("SLZ_MIN_BOUND", "", THESIS, "Boundary points a zone must have.")
    ] = 40
    certainty_rule: Annotated[
        Literal["safe", "certain"],
        Spec("SLZ_CERT_RULE", "", "SLZ paper Eq. 16-17", "Cells counted as certain: safe or measured."),
    ] = "safe"
    confidence_factor: Annotated[
        float, _in(0, 1), Spec("SLZ_CONF", "", PAPER, "Certainty from which a zone is drawn as certain.")
    ] = 0.86
    repeat_ratio: Annotated[
        float, _in(0, 1), Spec("SLZ_REPEAT", "", PAPER, "Boundary share inside an old zone that repeats it.")
    ] = 0.8
    area_ratio: Annotated[
        float, _in(0, 1), Spec("SLZ_AREA_RATIO", "", PAPER, "Least area ratio of a repeated zone.")
    ] = 0.9
    repeat_depth: Annotated[
        int,
        _in(1, 100000),
        Spec("SLZ_REP_DEPTH", "", "SLZ paper §3.4.3", "Earlier zones that the repeat filter looks at."),
    ] = 1000
    touchdown_error_m: Annotated[
        float,
        _in(0, 50),
        Spec("SLZ_TD_ERR_M", "m", OURS, "A landing point is safe when all cells this near to it are."),
    ] = 0.5
    surround_m: Annotated[
        float,
        _in(1, 1000),
        Spec("SLZ_SURR_M", "m", OURS, "How far around a landing point obstacles are listed."),
    ] = 30.0
    approach_slope_deg: Annotated[
        float,
        _in(3, 89),
        Spec("SLZ_APPR_SLOPE", "deg", OURS, "Least slope of a way in or out of a landing point."),
    ] = 30.0
    corridor_m: Annotated[
        float,
        _in(1, 1000),
        Spec("SLZ_CORR_M", "m", OURS, "How far from a landing point its ways in and out are judged."),
    ] = 60.0
    corridor_margin_m: Annotated[
        float,
        _in(0, 50),
        Spec("SLZ_CORR_MARG", "m", OURS, "Room beside the vehicle in a way in or out."),
    ] = 1.0
    vehicle_height_m: Annotated[
        float,
        _in(0.1, 30),
        Spec("SLZ_VEH_H_M", "m", OURS, "Height of a way in or out: the vehicle and room above and below it."),
    ] = 2.0
    max_zones: Annotated[
        int, _in(1, 10000), Spec("SLZ_MAX_ZONES", "", OURS, "Zones reported at most, best first.")
    ] = 64

    # ---- sensor ---------------------------------------------------------------------------------
    lidar_x_m: Annotated[
        float, _in(-20, 20), Spec("SLZ_LDR_X_M", "m", OURS, "LiDAR position forward of the autopilot.")
    ] = 0.1
    lidar_y_m: Annotated[
        float, _in(-20, 20), Spec("SLZ_LDR_Y_M", "m", OURS, "LiDAR position right of the autopilot.")
    ] = 0.0
    lidar_z_m: Annotated[
        float, _in(-20, 20), Spec("SLZ_LDR_Z_M", "m", OURS, "LiDAR position below the autopilot.")
    ] = 0.1
    lidar_roll_deg: Annotated[
        float,
        _in(-180, 180),
        Spec("SLZ_LDR_ROLL", "deg", OURS, "LiDAR boresight roll (docs/units_and_frames)."),
    ] = 0.0
    lidar_pitch_deg: Annotated[
        float, _in(-180, 180), Spec("SLZ_LDR_PITCH", "deg", OURS, "LiDAR boresight pitch.")
    ] = 112.5
    lidar_yaw_deg: Annotated[
        float, _in(-180, 180), Spec("SLZ_LDR_YAW", "deg", OURS, "LiDAR boresight yaw.")
    ] = 0.0
    lidar_min_m: Annotated[
        float, _in(0, 100), Spec("SLZ_LDR_MIN_M", "m", OURS, "Nearer returns are the vehicle itself or dust.")
    ] = 0.6
    lidar_max_m: Annotated[
        float, _in(1, 5000), Spec("SLZ_LDR_MAX_M", "m", OURS, "Farther returns are not used.")
    ] = 70.0
    vehicle_m: Annotated[
        float,
        _in(0, 20),
        Spec(
            "SLZ_VEHICLE_M",
            "m",
            OURS,
            "Returns nearer to the autopilot are its vehicle; 0 drops none.",
        ),
    ] = 0.0
    dust_reach_m: Annotated[
        float,
        _in(0, 100),
        Spec(
            "SLZ_DUST_R_M", "m", OURS, "Up to here weak returns and first ones of several are rain or dust."
        ),
    ] = 0.0
    dust_intensity: Annotated[
        int, _in(0, 255), Spec("SLZ_DUST_I", "", OURS, "Weaker returns within dust_reach_m are rain or dust.")
    ] = 4
    lidar_timeout_s: Annotated[
        float,
        _in(0.1, 30),
        Spec("SLZ_LDR_TOUT_S", "s", OURS, "Silence after which the LiDAR counts as lost."),
    ] = 1.0
    lidar_delay_ms: Annotated[
        float,
        _in(-500, 500),
        Spec("SLZ_LDR_DLY_MS", "ms", OURS, "Fixed delay between measurement and arrival, taken off."),
    ] = 0.0
    lidar_clock: Annotated[
        Literal["free", "ptp", "gps"],
        Spec("SLZ_LDR_CLOCK", "", OURS, "What the LiDAR's clock follows; this computer must follow it too."),
    ] = "free"

    # ---- link -----------------------------------------------------------------------------------
    component_id: Annotated[
        int, _in(1, 255), Spec("SLZ_COMPID", "", OURS, "MAVLink component number of this program.")
    ] = 191
    pose_rate_hz: Annotated[
        float, _in(5, 200), Spec("SLZ_POSE_HZ", "Hz", OURS, "Attitude and position rate asked for.")
    ] = 50.0
    pose_timeout_s: Annotated[
        float, _in(0.05, 10), Spec("SLZ_POSE_TOUT", "s", OURS, "Age beyond which a pose is stale.")
    ] = 0.5
    link_timeout_s: Annotated[
        float,
        _in(1, 60),
        Spec("SLZ_LINK_TOUT", "s", OURS, "Silence after which the autopilot is lost.", live=True),
    ] = 5.0
    landing_target_hz: Annotated[
        float, _in(3, 50), Spec("SLZ_TARGET_HZ", "Hz", OURS, "Rate of LANDING_TARGET.")
    ] = 20.0
    obstacle_hz: Annotated[
        float, _in(1, 50), Spec("SLZ_OBST_HZ", "Hz", OURS, "Rate of OBSTACLE_DISTANCE.", live=True)
    ] = 12.0

    record_mb: Annotated[
        float,
        _in(1, 1_000_000),
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
        _in(3, 500),
        Spec("SLZ_RALLY_H", "m", OURS, "Height of a rally point above its ground.", live=True),
    ] = 20.0

    # ---- landing --------------------------------------------------------------------------------
    survey_s: Annotated[
        float,
        _in(2, 3600),
        Spec("SLZ_SURVEY_S", "s", OURS, "Time spent surveying before a point is chosen.", live=True),
    ] = 30.0
    survey_speed_ms: Annotated[
        float, _in(0.2, 50), Spec("SLZ_SURV_SPD", "m/s", OURS, "Ground speed during the survey.", live=True)
    ] = 4.0
    survey_height_m: Annotated[
        float,
        _in(3, 500),
        Spec("SLZ_SURV_H", "m", OURS, "Lowest height above the take-off point to survey at.", live=True),
    ] = 15.0
    max_airspeed_ms: Annotated[
        float,
        _in(1, 100),
        Spec(
            "SLZ_MAX_ASPD",
            "m/s",
            OURS,
            "Greatest airspeed: with the wind it tells how soon a zone can be reached.",
            live=True,
        ),
    ] = 15.0
    search_legs_m: Annotated[
        float,
        _in(0, 5000),
        Spec(
            "SLZ_LEGS_M",
            "m",
            OURS,
            "Distance between the legs of the search for a zone; 0 is 1.6 times the mapping reach.",
            live=True,
        ),
    ] = 0.0
    approach_speed_ms: Annotated[
        float,
        _in(0.2, 50),
        Spec("SLZ_APPR_SPD", "m/s", OURS, "Ground speed towards the landing point.", live=True),
    ] = 4.0
    descent_speed_ms: Annotated[
        float,
        _in(0.1, 10),
        Spec("SLZ_DESC_SPD", "m/s", OURS, "Sink rate down to the final height.", live=True),
    ] = 1.5
    climb_speed_ms: Annotated[
        float, _in(0.1, 10), Spec("SLZ_CLIMB_SPD", "m/s", OURS, "Climb rate after an abort.", live=True)
    ] = 2.0
    crab_deg: Annotated[
        float,
        _in(-180, 180),
        Spec(
            "SLZ_CRAB_DEG",
            "deg",
            OURS,
            "Heading less course in flight: the LiDAR must see where the vehicle goes.",
            live=True,
        ),
    ] = 60.0
    final_height_m: Annotated[
        float,
        _in(1, 200),
        Spec(
            "SLZ_FINAL_H",
            "m",
            OURS,
            "Height above the point where the autopilot's LAND takes over.",
            live=True,
        ),
    ] = 12.0
    commit_height_m: Annotated[
        float,
        _in(0.2, 100),
        Spec(
            "SLZ_COMMIT_H", "m", OURS, "Height below which the landing is not broken off any more.", live=True
        ),
    ] = 1.5
    off_point_m: Annotated[
        float,
        _in(0.3, 50),
        Spec(
            "SLZ_OFF_PT",
            "m",
            OURS,
            "Farthest from the point in the autopilot's landing before it is broken off.",
            live=True,
        ),
    ] = 1.0
    dust_height_m: Annotated[
        float,
        _in(0, 100),
        Spec(
            "SLZ_DUST_H",
            "m",
            OURS,
            "Height above the point below which nothing is mapped (rotor dust): its last state holds.",
            live=True,
        ),
    ] = 1.5
    approach_path: Annotated[
        Literal["vertical", "sloped"],
        Spec(
            "SLZ_APPR_PATH",
            "",
            OURS,
            "Way down: straight down where that is clear, or along the least steep clear way in.",
            live=True,
        ),
    ] = "vertical"
    into_wind: Annotated[
        Literal["on", "off"],
        Spec(
            "SLZ_INTO_WIND",
            "",
            OURS,
            "Whether the vehicle turns into the wind before it descends, as far as its gear allows.",
            live=True,
        ),
    ] = "on"
    max_wind_ms: Annotated[
        float,
        _in(1, 50),
        Spec(
            "SLZ_MAX_WIND",
            "m/s",
            OURS,
            "Gust (greatest mean over 3 s of the last minute) above which only an emergency lands.",
            live=True,
        ),
    ] = 12.0
    drag_per_s: Annotated[
        float,
        _in(0, 2),
        Spec(
            "SLZ_DRAG",
            "1/s",
            OURS,
            "Deceleration of a multirotor per airspeed, for a wind from its tilt; 0 estimates none.",
        ),
    ] = 0.2
    battery_land_pct: Annotated[
        float,
        _in(0, 100),
        Spec("SLZ_BAT_LAND", "%", OURS, "Charge at which it lands at the nearest zone; 0 never.", live=True),
    ] = 15.0
    min_certainty: Annotated[
        float,
        _in(0, 1),
        Spec("SLZ_MIN_CERT", "", OURS, "Least certainty of a zone chosen to land in.", live=True),
    ] = 0.86
    uncertain_below: Annotated[
        float,
        _in(0, 1),
        Spec("SLZ_UNCERTAIN", "", OURS, "Certainty below which a zone is drawn as uncertain."),
    ] = 0.5

    @property
    def gear_size_m(self) -> tuple[float, float]:
        """Length and width of the gear between its outermost contacts."""
        length, width = GEAR_SHARES.get(self.gear, (0.0, 0.0))
        return self.gear_length_m or length * self.footprint_m, self.gear_width_m or width * self.footprint_m

    @property
    def greatest_tilt_deg(self) -> float:
        """Tilt of the landed vehicle below which it stands safely."""
        return self.tip_limit_deg or self.safe_slope_deg + TILT_OVER_SLOPE_DEG

    @property
    def greatest_dimension_m(self) -> float:
        """D: greatest dimension with rotors turning; 0 for a vehicle without disc, tail and D."""
        radius_m = self.rotor_diameter_m / 2
        return self.d_value_m or radius_m + max(radius_m, self.tail_length_m)

    @field_validator("*", mode="before")
    @classmethod
    def _no_truth_value(cls, value: Any) -> Any:
        if isinstance(value, bool):  # would count as 0 or 1
            raise ValueError("true and false are no values of a parameter")
        return value

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        for low, high in (
            ("lidar_min_m", "lidar_max_m"),
            ("commit_height_m", "final_height_m"),
            ("dust_height_m", "final_height_m"),
            ("cell_m", "min_square_m"),
            ("cell_m", "zone_m"),
            ("safe_slope_deg", "worst_slope_deg"),
            ("min_square_m", "zone_m"),
            ("hold_s", "max_age_s"),
        ):
            if getattr(self, low) > getattr(self, high):
                raise ValueError(
                    f"{low} ({getattr(self, low)}) must not exceed {high} ({getattr(self, high)})"
                )
        for size, most in CELLS_AT_MOST:
            if getattr(self, size) > most * self.cell_m:
                raise ValueError(
                    f"{size} ({getattr(self, size)}) must not exceed {most} cells of cell_m ({self.cell_m})"
                )
        if self.mode == "default" and self.gear != "none":
            self._check_gear()
        if self.mode == "default":
            self._check_discs()
        if self.mode == "default" and self.angle_noise_deg > 0 and self.range_noise_m >= self.height_noise_m:
            raise ValueError(
                f"range_noise_m ({self.range_noise_m}) must be less than height_noise_m"
                f" ({self.height_noise_m}), or no return is certain enough to be mapped"
            )
        return self

    def _check_gear(self) -> None:
        for name in ("gear_length_m", "gear_width_m"):
            if 0 < getattr(self, name) < LEAST_GEAR_M:
                raise ValueError(f"{name} ({getattr(self, name)}) must be 0 or at least {LEAST_GEAR_M} m")
        if self.safe_slope_deg > self.greatest_tilt_deg:
            raise ValueError(
                f"safe_slope_deg ({self.safe_slope_deg}) must not exceed tip_limit_deg"
                f" ({self.tip_limit_deg}), unless that is 0 or gear is none"
            )
        length_m, width_m = self.gear_size_m
        across_m = math.hypot(length_m, width_m) + 2 * self.pad_radius_m
        if across_m > self.footprint_m:
            raise ValueError(
                f"footprint_m ({self.footprint_m}) must hold the gear: {across_m:.2f} m across with"
                f" gear_length_m {length_m:g}, gear_width_m {width_m:g} and pad_radius_m {self.pad_radius_m}"
            )

    def _check_discs(self) -> None:
        for name in ("rotor_diameter_m", "tail_length_m", "d_value_m"):
            if 0 < getattr(self, name) < LEAST_GEAR_M:
                raise ValueError(f"{name} ({getattr(self, name)}) must be 0 or at least {LEAST_GEAR_M} m")
        length_m, width_m = self.gear_size_m
        if 0 < self.rotor_diameter_m < max(length_m, width_m):
            raise ValueError(
                f"rotor_diameter_m ({self.rotor_diameter_m}) must be 0 or no less than the gear, which is"
                f" {length_m:g} m long and {width_m:g} m wide"
            )
        if 0 < self.tail_length_m <= length_m / 2:
            raise ValueError(
                f"tail_length_m ({self.tail_length_m}) must be 0 or beyond the gear, which ends"
                f" {length_m / 2:g} m behind the centre of gravity"
            )
        for size, height in (("rotor_diameter_m", "rotor_height_m"), ("tail_length_m", "tail_height_m")):
            if getattr(self, size) > 0 and getattr(self, height) <= self.rotor_clearance_m:
                raise ValueError(
                    f"{height} ({getattr(self, height)}) must exceed rotor_clearance_m"
                    f" ({self.rotor_clearance_m}), unless {size} is 0"
                )
        radius_m = self.rotor_diameter_m / 2
        least_m = max(radius_m + max(radius_m, self.tail_length_m), length_m, width_m)
        if 0 < self.d_value_m < least_m - 1e-9:
            raise ValueError(
                f"d_value_m ({self.d_value_m}) must be 0 or at least {least_m:g} m, the size of gear,"
                f" rotor_diameter_m ({self.rotor_diameter_m}) and tail_length_m ({self.tail_length_m})"
            )


@dataclass(frozen=True, slots=True)
class Row:
    """Row of the parameter table for the command line, the parameter server and the documentation."""

    name: str
    mavlink: str
    unit: str
    kind: type
    low: float | None
    high: float | None
    choices: tuple[str, ...]
    default: Any
    source: str
    sentence: str
    live: bool
    grounded: Mapping[str, str] = field(default_factory=dict)

    @property
    def airworthy_choices(self) -> tuple[str, ...]:
        """Choices that may fly."""
        return tuple(choice for choice in self.choices if choice not in self.grounded)


def rows() -> tuple[Row, ...]:
    """Return the whole table in its order."""
    return tuple(_row(name) for name in Parameters.model_fields)


def _row(name: str) -> Row:
    field = Parameters.model_fields[name]
    spec = next(m for m in field.metadata if isinstance(m, Spec))
    bounds = {key: getattr(m, key) for m in field.metadata for key in ("ge", "le") if hasattr(m, key)}
    choices = getattr(field.annotation, "__args__", ())
    return Row(
        name=name,
        mavlink=spec.mavlink,
        unit=spec.unit,
        kind=str if choices else int if field.annotation is int else float,
        low=bounds.get("ge"),
        high=bounds.get("le"),
        choices=tuple(choices),
        default=field.default,
        source=spec.source,
        sentence=spec.sentence,
        live=spec.live,
        grounded=spec.grounded,
    )
