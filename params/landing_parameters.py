"""Parameters of landing."""

from __future__ import annotations

from typing import Annotated, Literal

from params.sensor_parameters import SensorParameters
from params.spec import OURS, Spec, in_range


class LandingParameters(SensorParameters):
    """Parameters of landing."""

    # ---- landing --------------------------------------------------------------------------------
    assist: Annotated[
        Literal["off", "offer", "act"],
        Spec(
            "SLZ_ASSIST",
            "",
            OURS,
            "Landings of the autopilot's own: let alone, offered a target, or taken over at the end.",
            live=True,
        ),
    ] = "off"
    survey_s: Annotated[
        float,
        in_range(2, 3600),
        Spec("SLZ_SURVEY_S", "s", OURS, "Time spent surveying before a point is chosen.", live=True),
    ] = 30.0
    survey_speed_ms: Annotated[
        float,
        in_range(0.2, 50),
        Spec("SLZ_SURV_SPD", "m/s", OURS, "Ground speed during the survey.", live=True),
    ] = 4.0
    survey_height_m: Annotated[
        float,
        in_range(3, 500),
        Spec("SLZ_SURV_H", "m", OURS, "Lowest height above the take-off point to survey at.", live=True),
    ] = 15.0
    max_airspeed_ms: Annotated[
        float,
        in_range(1, 100),
        Spec(
            "SLZ_MAX_ASPD",
            "m/s",
            OURS,
            "Greatest airspeed: with the wind it gives the time to a zone.",
            live=True,
        ),
    ] = 15.0
    search_legs_m: Annotated[
        float,
        in_range(0, 5000),
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
        in_range(0.2, 50),
        Spec("SLZ_APPR_SPD", "m/s", OURS, "Ground speed towards the landing point.", live=True),
    ] = 4.0
    descent_speed_ms: Annotated[
        float,
        in_range(0.1, 10),
        Spec("SLZ_DESC_SPD", "m/s", OURS, "Sink rate down to the final height.", live=True),
    ] = 1.5
    climb_speed_ms: Annotated[
        float, in_range(0.1, 10), Spec("SLZ_CLIMB_SPD", "m/s", OURS, "Climb rate after an abort.", live=True)
    ] = 2.0
    crab_deg: Annotated[
        float,
        in_range(-180, 180),
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
        in_range(1, 200),
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
        in_range(0.2, 100),
        Spec(
            "SLZ_COMMIT_H", "m", OURS, "Height below which the landing is not broken off any more.", live=True
        ),
    ] = 1.5
    off_point_m: Annotated[
        float,
        in_range(0.3, 50),
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
        in_range(0, 100),
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
        in_range(1, 50),
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
        in_range(0, 2),
        Spec(
            "SLZ_DRAG",
            "1/s",
            OURS,
            "Deceleration of a multirotor per airspeed, for a wind from its tilt; 0 estimates none.",
        ),
    ] = 0.2
    battery_land_pct: Annotated[
        float,
        in_range(0, 100),
        Spec("SLZ_BAT_LAND", "%", OURS, "Charge at which it lands at the nearest zone; 0 never.", live=True),
    ] = 15.0
    min_certainty: Annotated[
        float,
        in_range(0, 1),
        Spec("SLZ_MIN_CERT", "", OURS, "Least certainty of a zone chosen to land in.", live=True),
    ] = 0.86
    uncertain_below: Annotated[
        float,
        in_range(0, 1),
        Spec("SLZ_UNCERTAIN", "", OURS, "Certainty below which a zone is drawn as uncertain."),
    ] = 0.5
