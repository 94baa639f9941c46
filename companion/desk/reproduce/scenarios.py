"""The sources' scenes at the sources' resolution: 1 m near, 10 m far, with the helicopter's profile.

SLZ paper, Section 5, and SLZ thesis, Section 4.4. Surveys are sparse and fast, so that all of them fly
within a minute.
"""

from __future__ import annotations

from dataclasses import dataclass

from companion.desk.reproduce.source_scenes import Case, Settings
from companion.desk.reproduce.survey_recording import SurveyFlight

MODES = ("source", "default")
ONE_MAP = ("far_speed_ms=500", "far_height_m=10000")
"""Keeps near mode on: surveys are flown fast to be short, but use the map with cells of `cell_m`."""
NO_ID_REUSE = "repeat_ratio=1"
"""No share of a boundary exceeds this, so no zone reuses an old ID."""


@dataclass(frozen=True, slots=True)
class Scenario:
    """One scene as in the sources.

    settings: in both modes. default: additional ones in default mode. no_filter_m: side of the smallest
    square of a zone when the filter for room to land counts as off.
    """

    name: str
    survey: SurveyFlight
    settings: Settings = ()
    default: Settings = ("coverage_m=3", "footprint_m=3")
    no_filter_m: float = 3.0

    def case(self, mode: str, *more: str, room: bool = True) -> Case:
        """Return one run; room: with the profile's filter, a square of 24 m."""
        settings = [
            f"mode={mode}",
            *ONE_MAP,
            *self.settings,
            *(self.default if mode == "default" else ()),
            *more,
        ]
        if not room:
            settings.append(f"min_square_m={self.no_filter_m:g}")
        return Case(f"{self.name}, {mode} mode", self.survey, 2.0, "helicopter", tuple(settings))


def _near(
    scene: str,
    extent_m: tuple[float, float, float, float],
    *,
    height_m: float = 20.0,
    spacing_m: float = 20.0,
    speed_ms: float = 30.0,
    point_rate_hz: int = 40_000,
) -> SurveyFlight:
    return SurveyFlight(
        scene,
        extent_m,
        height_m=height_m,
        spacing_m=spacing_m,
        speed_ms=speed_ms,
        point_rate_hz=point_rate_hz,
        cell_m=1.0,
        footprint_m=3.0,
        slope_limit_deg=4.0,
    )


# The simulated sensor reaches 60 m on grass, so this is the greatest height that still shows the meadows.
_FAR = SurveyFlight(
    "hill",
    (-190.0, -190.0, 190.0, 190.0),
    height_m=45.0,
    spacing_m=40.0,
    speed_ms=50.0,
    point_rate_hz=20_000,
    cell_m=10.0,
    footprint_m=10.0,
    slope_limit_deg=4.0,
    relief_limit_m=1.0,
)

SCENARIOS = (
    # Begins 46 m south of the stadium's middle, north of the trees beyond the street.
    Scenario(
        "1 stadium", _near("stadium", (-120.0, -46.0, 200.0, 110.0)), settings=("min_boundary_points=80",)
    ),
    # The road is 8 m wide with cars on both sides, so a footprint of 3 m leaves nothing between them.
    Scenario(
        "2 road and yards",
        _near("streets", (-80.0, -60.0, 80.0, 60.0), speed_ms=20.0, point_rate_hz=50_000),
        settings=("min_boundary_points=50",),
        default=("coverage_m=2", "footprint_m=2"),
    ),
    Scenario(
        "3 plain between mountains",
        _near("mountains", (-120.0, -120.0, 120.0, 120.0), height_m=30.0, spacing_m=25.0),
    ),
    Scenario(
        "4 dense buildings",
        _near("dense", (-100.0, -100.0, 100.0, 100.0), spacing_m=16.0),
        settings=("min_boundary_points=50",),
    ),
    # 200 boundary points at 1 m correspond to 20 at 10 m.
    Scenario(
        "5 hill",
        _FAR,
        settings=("cell_m=10", "min_boundary_points=20"),
        default=("coverage_m=10", "footprint_m=10", "relief_m=1"),
        no_filter_m=10.0,
    ),
)
BY_SCENE = {scenario.survey.scene: scenario for scenario in SCENARIOS}

ENTRANCE = Scenario(
    "1 stadium, along the entrance",
    _near("stadium", (60.0, -42.0, 115.0, -2.0), spacing_m=40.0, speed_ms=8.0, point_rate_hz=100_000),
    settings=("zone_m=400",),
)
"""One line over the entrance: seven windows, and each adds a little to one zone."""
