"""Main mission on a real PX4, judged by its simulator's true pose."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.e2e.autopilot_flights import HEIGHT_M, climbs_without_lidar, lands_where_it_chose
from tests.e2e.px4 import SIH_NOISE, Px4Field, Px4Pilot

pytestmark = [pytest.mark.px4, pytest.mark.realtime, pytest.mark.timeout(900)]

ERROR_M = 0.5
FAR_M, RALLY_ERROR_M = 15.0, 2.0
SETTINGS = "survey_s=15", "zone_m=200", *SIH_NOISE


@pytest.fixture
def binary(request: pytest.FixtureRequest) -> Path:
    """Return the binary that the user named."""
    path: Path = request.config.getoption("--px4")
    assert path.is_file(), f"--px4 {path}: no such file"
    return path


def test_it_lands_where_it_chose_on_safe_ground(binary: Path, tmp_path: Path) -> None:
    said = lands_where_it_chose(Px4Field(binary, tmp_path, scene="stadium", seed=1), ERROR_M, *SETTINGS)
    assert not [text for text in said if "anding target" in text]


def test_a_lidar_silent_at_six_metres_makes_it_climb_and_call_the_pilot(binary: Path, tmp_path: Path) -> None:
    climbs_without_lidar(Px4Field(binary, tmp_path, scene="stadium", seed=1), *SETTINGS)


def test_the_pilot_who_changes_the_mode_has_the_vehicle(binary: Path, tmp_path: Path) -> None:
    """In the approach and, after a second hand-over, in the autopilot's landing."""
    with Px4Field(binary, tmp_path, scene="stadium", seed=1) as field:
        pilot = field.pilot
        field.run_companion(*SETTINGS)
        pilot.take_off(HEIGHT_M)
        pilot.until(lambda: pilot.hears("approaching"), 120, "approach")
        pilot.wait(lambda: False, 2.0)
        pilot.set_mode("AUTO.LOITER")
        pilot.until(lambda: pilot.mode == "AUTO.LOITER", 5, "AUTO.LOITER")
        before = len(pilot.modes)
        pilot.wait(lambda: False, 10.0)
        assert pilot.modes[before:] == []
        assert pilot.hears("hands off")
        pilot.hand_over()
        pilot.until(lambda: pilot.mode == "AUTO.PRECLAND" and pilot.height_m < 8.0, 400, "landing at 8 m")
        pilot.set_mode("AUTO.LOITER")
        pilot.until(lambda: pilot.mode == "AUTO.LOITER", 5, "AUTO.LOITER")
        before = len(pilot.modes)
        pilot.wait(lambda: False, 10.0)
        assert pilot.modes[before:] == []
        assert pilot.armed
        assert pilot.height_m > 3.0
        assert field.ended().summary["pilot_took_over"] == 2


def test_rtl_lands_on_a_rally_point_that_the_companion_gave(binary: Path, tmp_path: Path) -> None:
    """A point in frame 5 or 6 would be acknowledged too, and send it towards latitude 0, longitude 0."""
    with Px4Field(binary, tmp_path, scene="stadium", seed=1) as field:
        pilot = field.pilot
        assert isinstance(pilot, Px4Pilot)
        field.run_companion("survey_s=120", "zone_m=200", "rally=on", *SIH_NOISE)
        pilot.take_off(HEIGHT_M)
        pilot.until(lambda: len(far_points(pilot)) > 0, 120, f"rally point {FAR_M:g} m from home")
        pilot.go_to(*max(far_points(pilot), key=pilot.from_home_m), HEIGHT_M)
        pilot.set_mode("AUTO.RTL")
        pilot.until(lambda: pilot.mode == "AUTO.RTL", 5, "AUTO.RTL")
        points = far_points(pilot)
        pilot.until(lambda: not pilot.armed, 200, "landing")
        assert min(pilot.away_m(point) for point in points) < RALLY_ERROR_M


def far_points(pilot: Px4Pilot) -> list[tuple[float, float]]:
    """Return the rally points that are not at home, nor far off on the globe."""
    places = [(point.x * 1e-7, point.y * 1e-7) for point in pilot.rally_points()]
    assert all(pilot.from_home_m(place) < 300 for place in places)
    return [place for place in places if pilot.from_home_m(place) > FAR_M]
