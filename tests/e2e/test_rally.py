"""Rally points after the companion died in flight: the autopilot's RTL lands on surveyed ground."""

from __future__ import annotations

import asyncio
import contextlib

import numpy as np
import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from sitl.autopilot.modes import Mode
from tests.e2e.harness import Mission

pytestmark = pytest.mark.long

EAST_M, NORTH_M = 45.0, 20.0


async def _flight(mission: Mission) -> tuple[list[np.ndarray], np.ndarray]:
    sim, pilot = mission.sim, mission.sim.pilot
    assert pilot is not None
    mission.start()
    await mission.until(lambda: pilot.done and mission.height_m > 20)
    home = sim.autopilot.navigator.home_enu_m
    there = (float(home[0]) + EAST_M, float(home[1]) + NORTH_M)
    frame, ignore = mavlink.MAV_FRAME_LOCAL_NED, 0b110111111000
    pilot.send(
        mavlink.MAVLink_set_position_target_local_ned_message(
            0, 1, 1, frame, ignore, there[1], there[0], -25.0 - float(home[2]), 0, 0, 0, 0, 0, 0, 0, 0
        )
    )
    await mission.until(lambda: np.hypot(*(sim.vehicle.truth.pos_enu_m[:2] - there)) < 3.0)
    await asyncio.sleep(15)
    await mission.until(
        lambda: sim.autopilot.rally.items and not mission.companion.telling.services.rally.busy
    )
    assert mission.task is not None
    mission.task.cancel()
    with contextlib.suppress(asyncio.CancelledError):
        await mission.task
    points, home = sim.autopilot.rally.points_enu_m(), home.copy()
    sim.lidar_on = False
    pilot.set_mode(Mode.RTL)
    end = mission.loop.time() + 180
    while sim.autopilot.armed:
        assert mission.loop.time() < end
        await asyncio.sleep(0.5)
    return points, home


@pytest.mark.timeout(600)
def test_rtl_lands_on_a_surveyed_zone_when_the_companion_is_dead() -> None:
    mission = Mission("stadium", auto=False, height_m=25.0, rally="on", rally_height_m=25.0)
    try:
        points, home = mission.loop.run_until_complete(_flight(mission))
    finally:
        if mission.task is not None:
            mission.task.cancel()
            mission.loop.run_until_complete(asyncio.gather(mission.task, return_exceptions=True))
        mission.sim.close()
        mission.loop.close()
    contact = mission.sim.touchdown
    assert contact is not None
    touchdown = np.array([contact["e"], contact["n"]])
    off = [float(np.hypot(*(touchdown - point[:2]))) for point in points]
    assert 1 <= len(points) <= 5
    assert min(off) < 1.5
    assert np.hypot(*(touchdown - home[:2])) > 10
    assert mission.touchdown_safe()
