"""Main mission on a real ArduCopter, judged by its simulator's true pose."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.e2e.arducopter import ArduCopterField
from tests.e2e.autopilot_flights import climbs_without_lidar, lands_where_it_chose

pytestmark = [pytest.mark.arducopter, pytest.mark.realtime, pytest.mark.timeout(900)]

ERROR_M = 0.3
SETTINGS = "survey_s=15", "zone_m=200"


@pytest.fixture
def binary(request: pytest.FixtureRequest) -> Path:
    """Return the binary that the user named."""
    path: Path = request.config.getoption("--arducopter")
    assert path.is_file(), f"--arducopter {path}: no such file"
    return path


def test_it_lands_where_it_chose_on_safe_ground(binary: Path, tmp_path: Path) -> None:
    field = ArduCopterField(binary, tmp_path, scene="stadium", seed=1)
    said = lands_where_it_chose(field, ERROR_M, *SETTINGS)
    assert not [text for text in said if "PLND" in text or "Frame" in text]


def test_a_lidar_silent_at_six_metres_makes_it_climb_and_call_the_pilot(binary: Path, tmp_path: Path) -> None:
    climbs_without_lidar(ArduCopterField(binary, tmp_path, scene="stadium", seed=1), *SETTINGS)
