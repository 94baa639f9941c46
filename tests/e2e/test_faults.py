"""A few flights of the fault campaign; all of it: `make campaign`."""

from pathlib import Path

import pytest

from companion.flight.landing.situation import Phase
from sitl import scenes
from sitl.truth.touchdown import footing
from tests.campaign import reactions
from tests.campaign.flight import fly
from tests.campaign.plan import Plan, number_of, plan


@pytest.mark.parametrize(
    ("fault", "state"),
    [
        pytest.param("lidar_stop", Phase.FINAL, marks=pytest.mark.bench),  # flown in test_landing.py too
        ("ekf_jump", Phase.FINAL),
        ("killed", Phase.DESCEND),
        ("wing_flight", Phase.APPROACH),
        pytest.param("second_companion", Phase.SURVEY, marks=pytest.mark.bench),
        ("link_bursts", Phase.APPROACH),
    ],
)
def test_a_fault_in_a_state_of_the_landing_meets_the_stated_reaction(
    fault: str, state: Phase, tmp_path: Path
) -> None:
    flown = fly(plan(number_of(fault, state)), tmp_path)
    assert flown["began_s"] is not None
    assert reactions.faults_of(flown) == []


@pytest.mark.parametrize("number", [2, pytest.param(4, marks=pytest.mark.bench)])  # 4 on request
def test_among_kerbs_the_vehicle_lands_where_its_gear_stands(number: int, tmp_path: Path) -> None:
    flown = fly(Plan(number, "none", Phase.SURVEY, "streets", 0.5, 4.0, 1.0), tmp_path)
    assert reactions.faults_of(flown) == []
    standing = footing(scenes.build("streets", number).world, flown["touchdown"])
    assert standing.tilt_deg is not None
    assert standing.tilt_deg < 8.0
