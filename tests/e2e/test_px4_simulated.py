"""Flights with the simulator's PX4: the main mission, and a return that is led to safe ground."""

from __future__ import annotations

import asyncio

import numpy as np
import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from sitl.autopilot.px4.px4_modes import Px4Mode
from tests.campaign.own_landings import NEAR
from tests.campaign.sortie import LIDAR_MS
from tests.e2e.harness import Mission

pytestmark = pytest.mark.long

PX4 = {"autopilot_kind": "px4", "lidar_ms": LIDAR_MS}


def modes(mission: Mission) -> list[str]:
    return [mode for _, mode in mission.sim.autopilot.mode_changes]


def test_offboard_and_precision_landing_end_on_the_chosen_point() -> None:
    """Setting OFFBOARD is the hand-over; it is refused until the companion sends setpoints."""
    mission = Mission(simulated=PX4, **NEAR)

    async def script(m: Mission) -> None:
        pilot, autopilot = m.sim.pilot, m.sim.autopilot
        assert pilot is not None
        await m.until(lambda: autopilot.mode is Px4Mode.AUTO_LOITER)
        while autopilot.mode is Px4Mode.AUTO_LOITER:
            pilot.set_mode(Px4Mode.OFFBOARD)
            await asyncio.sleep(1.0)
        await m.until(lambda: not autopilot.armed)

    mission.fly(script)
    assert modes(mission)[:4] == ["AUTO.TAKEOFF", "AUTO.LOITER", "OFFBOARD", "AUTO.PRECLAND"]
    assert mission.touchdown_safe()
    assert mission.touchdown_error_m() < 0.5
    assert not [text for text in mission.heard if "anding target" in text]


def test_a_return_of_the_pilots_ends_on_the_offered_target() -> None:
    """A return lands where a target leads, with RTL_PLD_MD 1, and nothing is commanded."""
    parameters = {"RTL_RETURN_ALT": 18.0}
    simulated = {**PX4, "parameters": parameters}
    mission = Mission("stadium", auto=False, assist="offer", simulated=simulated, **NEAR)

    async def script(m: Mission) -> None:
        pilot, autopilot = m.sim.pilot, m.sim.autopilot
        assert pilot is not None
        await m.until(lambda: autopilot.mode is Px4Mode.AUTO_LOITER)
        there = m.sim.vehicle.truth.pos_enu_m + np.array([8.0, 8.0, 0.0])
        lat, lon, alt = autopilot.lla(there)
        pilot.command(mavlink.MAV_CMD_DO_REPOSITION, -1, 1, 0, np.nan, lat, lon, alt)
        await m.until(lambda: bool(np.hypot(*(m.sim.vehicle.truth.pos_enu_m - there)[:2]) < 0.7))
        await asyncio.sleep(4.0)
        pilot.set_mode(Px4Mode.AUTO_RTL)
        await m.until(lambda: autopilot.mode is Px4Mode.AUTO_RTL)
        await m.until(lambda: not autopilot.armed)
        await asyncio.sleep(0.5)

    mission.fly(script)
    assert modes(mission) == ["AUTO.TAKEOFF", "AUTO.LOITER", "AUTO.RTL", "AUTO.LOITER"]
    assert mission.touchdown_safe()
    assist = mission.companion.summary["assist"]
    assert assist["led"] == 1
    assert assist["off_m"][0] < 0.3
