"""A few flights of the fault campaign; all of it: `make campaign`."""

import asyncio
from pathlib import Path

import pytest

from companion.flight.landing.situation import Phase
from sitl import faults, scenes
from sitl.truth.touchdown import footing
from tests.campaign import reactions
from tests.campaign.flight import fly
from tests.campaign.plan import Plan, number_of, plan
from tests.e2e.brief import brief
from tests.e2e.harness import Mission

pytestmark = pytest.mark.long


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
    if fault == "ekf_jump":
        assert flown["aborts"] == ["map begun anew"]  # "late" it would be for a slow computer


@pytest.mark.parametrize("number", [2, pytest.param(4, marks=pytest.mark.bench)])  # 4 on request
def test_among_kerbs_the_vehicle_lands_where_its_gear_stands(number: int, tmp_path: Path) -> None:
    flown = fly(Plan(number, "none", Phase.SURVEY, "streets", 0.5, 4.0, 1.0), tmp_path)
    assert reactions.faults_of(flown) == []
    standing = footing(scenes.build("streets", number).world, flown["touchdown"])
    assert standing.tilt_deg is not None
    assert standing.tilt_deg < 8.0


@pytest.mark.parametrize(
    ("size_m", "height_m", "odometry"),
    [
        (-3.0, 4.0, "off"),
        *(
            pytest.param(*each, marks=pytest.mark.bench)
            for each in (
                *((size_m, height_m, "off") for height_m in (2.0, 4.0, 8.0) for size_m in (3.0, -3.0)),
                (3.0, 4.0, "map"),
                (-3.0, 4.0, "map"),
            )
        ),
    ],
)
def test_a_barometer_that_jumps_in_the_descent_ends_no_landing(
    size_m: float, height_m: float, odometry: str
) -> None:
    """Without the height datum: four aborts, and "target lost: take over" where it jumps down at 2 m."""
    slow = {"LAND_SPEED": 50.0, "LAND_ALT_LOW": 1000.0}
    mission = Mission("plain", seed=1, odometry=odometry, **brief(parameters=slow))
    (jump,) = faults.read(f"baro_jump={size_m}@{height_m}", 1)
    mission.sim.every_tick.append(jump)

    async def script(m: Mission) -> None:
        await m.until(lambda: m.sim.touchdown is not None and not m.sim.autopilot.armed)
        await asyncio.sleep(2)

    mission.fly(script)
    assert jump.has_begun
    assert mission.companion.executive.tally.abort_reasons == []
    assert not [text for text in mission.heard if "take over" in text]
    assert mission.touchdown_safe()
    assert mission.touchdown_error_m() <= 0.5
