"""Other MAVLink systems on the companion's link from the start."""

from __future__ import annotations

import asyncio

import numpy as np
import pytest

from companion.flight.landing.situation import Phase
from companion.flight.link.vehicle_identity import AmbiguousVehicleError
from sitl import faults
from tests.e2e.harness import Mission


def beside(mission: Mission, name: str) -> None:
    """Put somebody on the line for the whole flight."""
    fault = faults.build(name, np.random.default_rng(1))
    fault.start(mission.sim)
    mission.sim.every_tick.append(fault.on_tick)


def test_two_vehicles_end_the_program_by_name_before_it_commands() -> None:
    mission = Mission()
    beside(mission, "second_vehicle")
    try:
        with pytest.raises(AmbiguousVehicleError, match=r"system 1 \(quadrotor\) and system 2 \(quadrotor\)"):
            mission.loop.run_until_complete(asyncio.wait_for(mission.companion.run(), 10.0))
    finally:
        mission.sim.close()
        mission.loop.close()


@pytest.mark.bench  # on request, for its time
def test_it_lands_beside_a_gimbal_of_its_own_system() -> None:
    mission = Mission()
    beside(mission, "gimbal")

    async def flight(flown: Mission) -> None:
        await flown.until_phase(Phase.LANDED)

    mission.fly(flight)
    assert mission.touchdown_safe()
    assert mission.touchdown_error_m() < 0.5
    assert mission.companion.executive.tally.aborts == 0
