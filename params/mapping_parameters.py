"""Parameters of windows and terrain models."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict

from params.spec import OURS, PAPER, THESIS, Spec, in_range

# Why a value must not fly, as a predicate of the value.
SOURCE_MODE = "calls unsafe ground safe: the paper's rules to the letter, for surveys only"
ODOMETRY_TO_AUTOPILOT = (
    "led a vehicle away: an unobserved axis counts as observed, and the autopilot's estimate of what it is"
    " sent confirms itself"
)


class MappingParameters(BaseModel):
    """Parameters of windows and terrain models."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False, validate_default=True)

    # ---- pre-processing -------------------------------------------------------------------------
    window_s: Annotated[
        float,
        in_range(0.05, 10),
        Spec(
            "SLZ_WINDOW_S",
            "s",
            PAPER,
            "Time span of returns judged together; a window in flight is a tenth, longer on slow computers.",
        ),
    ] = 1.0
    zone_m: Annotated[
        float,
        in_range(20, 20000),
        Spec("SLZ_ZONE_M", "m", THESIS, "Side of the square map around its origin."),
    ] = 400.0
    max_range_m: Annotated[
        float,
        in_range(1, 5000),
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
        float, in_range(0.05, 50), Spec("SLZ_CELL_M", "m", THESIS, "Side of a cell of the near map.")
    ] = 0.2
    far_cell_m: Annotated[
        float, in_range(0.5, 100), Spec("SLZ_FAR_CELL_M", "m", THESIS, "Side of a cell of the far map.")
    ] = 2.0
    far_height_m: Annotated[
        float,
        in_range(1, 10000),
        Spec("SLZ_FAR_H_M", "m", OURS, "Height over ground above which far mode is active."),
    ] = 40.0
    far_speed_ms: Annotated[
        float,
        in_range(1, 500),
        Spec("SLZ_FAR_SPD", "m/s", OURS, "Ground speed above which far mode is active."),
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
        in_range(16, 32_768),
        Spec("SLZ_MEMORY_MB", "MiB", OURS, "Most memory for evidence of the ground (default mode)."),
    ] = 512.0
    histogram_bins: Annotated[
        int, in_range(10, 10000), Spec("SLZ_HIST_BINS", "", THESIS, "Bins of the vertical outlier histogram.")
    ] = 300
    histogram_threshold: Annotated[
        float,
        in_range(0.5, 1),
        Spec("SLZ_HIST_THR", "", THESIS, "Least share of points the outlier filter must keep."),
    ] = 0.9
    outlier_gap_m: Annotated[
        float,
        in_range(0.5, 1000),
        Spec(
            "SLZ_OUTL_GAP_M",
            "m",
            OURS,
            "Empty vertical gap that sets a few points apart as outliers (default mode).",
        ),
    ] = 5.0
    worst_slope_deg: Annotated[
        float,
        in_range(5, 90),
        Spec(
            "SLZ_WORST_SLOPE",
            "deg",
            PAPER,
            "Slope of unseen ground in source mode, which writes only slopes below it.",
        ),
    ] = 40.0
    safe_slope_deg: Annotated[
        float, in_range(0.5, 45), Spec("SLZ_SAFE_SLOPE", "deg", PAPER, "A safe cell slopes less than this.")
    ] = 10.0
    fusing: Annotated[
        Literal["mean", "max"],
        Spec("SLZ_FUSING", "", PAPER, "How source mode joins a cell's old and new values."),
    ] = "mean"
    footprint_m: Annotated[
        float,
        in_range(0.1, 50),
        Spec("SLZ_FOOTPRINT_M", "m", OURS, "Side of the square of ground under the landed vehicle."),
    ] = 2.0
    relief_m: Annotated[
        float,
        in_range(0.02, 5),
        Spec(
            "SLZ_RELIEF_M",
            "m",
            OURS,
            "Height from the lowest to the highest ground about the footprint's plane that is a hazard.",
        ),
    ] = 0.3
    hazard_size_m: Annotated[
        float,
        in_range(0.05, 5),
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
        in_range(0, 30),
        Spec(
            "SLZ_GEAR_L_M",
            "m",
            OURS,
            "Front to rear pads, or length of the skids; 0 is 0.285 footprint_m, of skids or a tripod 0.6.",
        ),
    ] = 0.0
    gear_width_m: Annotated[
        float,
        in_range(0, 30),
        Spec(
            "SLZ_GEAR_W_M",
            "m",
            OURS,
            "Left to right pads or skids; 0 is 0.285 footprint_m, of skids or a tripod 0.44.",
        ),
    ] = 0.0
    pad_radius_m: Annotated[
        float,
        in_range(0.005, 2),
        Spec("SLZ_PAD_R_M", "m", OURS, "Radius of a pad, or half the width of a skid."),
    ] = 0.03
    clearance_m: Annotated[
        float,
        in_range(0.02, 10),
        Spec("SLZ_CLEAR_M", "m", OURS, "Height of the belly over the plane on which the gear rests."),
    ] = 0.3
    tip_limit_deg: Annotated[
        float,
        in_range(0, 80),
        Spec(
            "SLZ_TIP_LIM",
            "deg",
            OURS,
            "The landed vehicle must tilt less than this; 0 is 5 degrees more than safe_slope_deg.",
        ),
    ] = 0.0
    rotor_diameter_m: Annotated[
        float,
        in_range(0, 60),
        Spec(
            "SLZ_ROTOR_D_M",
            "m",
            OURS,
            "Main rotor disc, or circle around all propellers; 0 judges no disc.",
        ),
    ] = 0.0
    rotor_height_m: Annotated[
        float,
        in_range(0, 30),
        Spec("SLZ_ROTOR_H_M", "m", OURS, "Height of that disc over the plane on which the gear rests."),
    ] = 0.0
    rotor_clearance_m: Annotated[
        float,
        in_range(0.02, 10),
        Spec("SLZ_ROTOR_CLR", "m", OURS, "Least distance of obstacles from disc and tail, all around."),
    ] = 0.3
    tail_length_m: Annotated[
        float,
        in_range(0, 60),
        Spec(
            "SLZ_TAIL_L_M", "m", OURS, "From the centre of gravity to the end of the tail; 0 judges no tail."
        ),
    ] = 0.0
    tail_width_m: Annotated[
        float, in_range(0.05, 20), Spec("SLZ_TAIL_W_M", "m", OURS, "Width of the tail at its widest.")
    ] = 0.5
    tail_height_m: Annotated[
        float,
        in_range(0, 30),
        Spec(
            "SLZ_TAIL_H_M",
            "m",
            OURS,
            "Height of the tail's lowest part, its rotor or guard, over the plane on which the gear rests.",
        ),
    ] = 0.0
    d_value_m: Annotated[
        float,
        in_range(0, 100),
        Spec(
            "SLZ_D_VALUE_M",
            "m",
            OURS,
            "D: greatest dimension with rotors turning; 0 is that of disc and tail, without these none.",
        ),
    ] = 0.0
    water_suspicion: Annotated[
        float,
        in_range(0, 1),
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
        in_range(0.1, 50),
        Spec("SLZ_COVER_M", "m", OURS, "Unseen gaps at least this wide make ground unknown."),
    ] = 1.0
    range_noise_m: Annotated[
        float,
        in_range(0, 1),
        Spec("SLZ_NOISE_M", "m", OURS, "Standard deviation of one return along its ray."),
    ] = 0.02
    angle_noise_deg: Annotated[
        float,
        in_range(0, 5),
        Spec("SLZ_ANGLE_NOISE", "deg", OURS, "Standard deviation of a ray's direction."),
    ] = 0.15
    height_noise_m: Annotated[
        float,
        in_range(0.01, 5),
        Spec("SLZ_HEIGHT_NOISE", "m", OURS, "Returns whose height is less certain than this are not mapped."),
    ] = 0.045
    register_m: Annotated[
        float,
        in_range(0, 5),
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
        in_range(0.5, 600),
        Spec("SLZ_HOLD_S", "s", OURS, "A hazard seen is kept at least this long against newer returns."),
    ] = 8.0
    max_age_s: Annotated[
        float,
        in_range(1, 86400),
        Spec("SLZ_MAX_AGE_S", "s", OURS, "Ground not seen for longer counts as unknown."),
    ] = 300.0
