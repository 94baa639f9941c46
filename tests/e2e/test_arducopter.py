"""The main job on a real ArduCopter, judged by the pose that its simulator says is true."""

from __future__ import annotations

import signal
from pathlib import Path

import pytest

from tests.e2e.arducopter import ArduCopterField

pytestmark = [pytest.mark.arducopter, pytest.mark.realtime, pytest.mark.timeout(900)]

HEIGHT_M = 25.0
ERROR_M = 0.3


@pytest.fixture
def binary(request: pytest.FixtureRequest) -> Path:
    """Return the binary that the user named."""
    path: Path = request.config.getoption("--arducopter")
    assert path.is_file(), f"--arducopter {path}: no such file"
    return path


def test_it_lands_where_it_chose_on_safe_ground(binary: Path, tmp_path: Path) -> None:
    with ArduCopterField(binary, tmp_path, scene="stadium", seed=1) as field:
        field.run_companion("survey_s=15", "zone_m=200")
        field.pilot.take_off(HEIGHT_M)
        outcome = field.land()
    assert outcome.summary["landed"]
    assert outcome.safe
    assert outcome.error_m is not None
    assert outcome.error_m <= ERROR_M
    assert not [text for text in outcome.said if "PLND" in text or "Frame" in text]


def test_a_lidar_silent_at_six_metres_makes_it_climb_and_call_the_pilot(binary: Path, tmp_path: Path) -> None:
    with ArduCopterField(binary, tmp_path, scene="stadium", seed=1) as field:
        pilot = field.pilot
        field.run_companion("survey_s=15", "zone_m=200")
        pilot.take_off(HEIGHT_M)
        pilot.until(lambda: pilot.mode == "LAND" and pilot.height_m < 6.0, 300, "LAND at 6 m")
        field.lidar.send_signal(signal.SIGSTOP)
        lowest_m = pilot.height_m

        def climbs() -> bool:
            nonlocal lowest_m
            lowest_m = min(lowest_m, pilot.height_m)
            return pilot.mode == "GUIDED" and pilot.height_m > 12.0

        pilot.until(climbs, 60, "climb")
        pilot.until(lambda: any("take over" in text for text in pilot.said), 60, "call for the pilot")
        field.lidar.send_signal(signal.SIGCONT)
        assert pilot.armed
        assert pilot.mode == "GUIDED"
        assert lowest_m > 3.0
        assert any("LiDAR lost" in text for text in pilot.said)
