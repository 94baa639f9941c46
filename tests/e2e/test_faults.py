"""A few flights of the fault campaign; all of it: `make campaign`."""

from pathlib import Path

import pytest

from companion.flight.landing.situation import Phase
from tests.campaign import reactions
from tests.campaign.flight import fly
from tests.campaign.plan import number_of, plan


@pytest.mark.parametrize(
    ("fault", "state"),
    [
        ("lidar_stop", Phase.FINAL),
        ("ekf_jump", Phase.FINAL),
        ("killed", Phase.DESCEND),
        ("link_bursts", Phase.APPROACH),
    ],
)
def test_a_fault_in_a_state_of_the_landing_meets_the_stated_reaction(
    fault: str, state: Phase, tmp_path: Path
) -> None:
    flown = fly(plan(number_of(fault, state)), tmp_path)
    assert flown["began_s"] is not None
    assert reactions.faults_of(flown) == []
