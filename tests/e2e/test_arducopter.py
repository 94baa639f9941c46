"""The main job on a real ArduCopter, judged by the pose that its simulator says is true."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.e2e.arducopter import Field

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
    with Field(binary, tmp_path, scene="stadium", seed=1) as field:
        field.run_companion("survey_s=15", "zone_m=200")
        field.pilot.take_off(HEIGHT_M)
        field.pilot.until(lambda: field.pilot.mode == "LAND", 300, "LAND")
        field.pilot.until(lambda: not field.pilot.armed, 120, "landing")
        outcome = field.ended()
    assert outcome.summary["landed"]
    assert outcome.safe
    assert outcome.error_m is not None
    assert outcome.error_m <= ERROR_M
    assert not [text for text in outcome.said if "PLND" in text or "Frame" in text]
