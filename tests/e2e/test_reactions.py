"""Reactions of docs/reactions.md, flown."""

from __future__ import annotations

import asyncio
import contextlib

import numpy as np
import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from companion.flight.landing.situation import Phase
from sitl.autopilot.modes import Mode
from sitl.world.primitives import Box
from tests.e2e.brief import brief
from tests.e2e.harness import Mission

WALL_M, WALL_WIDE_M, WALL_HIGH_M = 36.0, 5.0, 22.0


def test_an_emergency_in_loiter_lands_at_once() -> None:
    mission = Mission(seed=10, auto=False, **brief())

    async def script(m: Mission) -> None:
        assert m.sim.pilot is not None
        await m.until(lambda: bool(m.companion.mapping.latest.zones_seen))
        await m.until(lambda: m.height_m > 11)
        m.sim.pilot.set_mode(Mode.LOITER)
        await m.until(lambda: m.sim.autopilot.mode is Mode.LOITER)
        await asyncio.sleep(3)
        m.sim.pilot.command(mavlink.MAV_CMD_USER_1, 4, component=191)
        await m.until_phase(Phase.LANDED, 120)

    mission.fly(script)
    assert mission.touchdown_safe()
    assert (mavlink.MAV_CMD_USER_1, 0) in (mission.sim.pilot.acks if mission.sim.pilot else [])
    assert mission.companion.executive.tally.hands_off == 0


@pytest.mark.long
def test_a_low_battery_ends_the_survey_and_below_the_dust_height_nothing_is_mapped() -> None:
    mission = Mission(seed=11, **brief(survey_s=300.0, dust_height_m=4.0))

    async def script(m: Mission) -> None:
        await m.until_phase(Phase.SURVEY)
        await m.until(lambda: bool(m.companion.mapping.latest.zones_seen))
        m.sim.autopilot.battery_pct = 14.0
        await m.until_phase(Phase.FINAL, 120)
        await m.until(lambda: m.height_m < 3.0)
        await asyncio.sleep(0.5)
        reports = m.companion.mapping.worker.reports
        await m.until_phase(Phase.LANDED)
        assert m.companion.mapping.worker.reports <= reports + 1

    mission.fly(script)
    assert mission.touchdown_safe()
    assert any("battery low" in text for text in mission.heard)
    assert mission.companion.executive.tally.aborts == 0


@pytest.mark.long
def test_a_wall_in_dust_is_passed_over_with_avoidance_on() -> None:
    """Specks neither stop the vehicle nor hide the wall."""
    simulated = {"parameters": {"PRX1_TYPE": 2.0, "AVOID_ENABLE": 3.0}, "point_rate_hz": 50_000}
    mission = Mission(seed=14, auto=False, height_m=15.0, simulated=simulated)
    mission.sim.fill_air("dust")
    world = mission.sim.scene.world

    async def script(m: Mission) -> None:
        assert m.sim.pilot is not None
        await m.until(lambda: bool(m.companion.mapping.latest.zones_seen))
        await m.until(lambda: m.height_m > 13.5)
        e, n, _ = (float(v) for v in m.sim.vehicle.truth.pos_enu_m)
        world.add_mover("wall", [Box(0.0, 0.0, 0.0, 0.5, WALL_WIDE_M, WALL_HIGH_M)], e + WALL_M, n, 0.0)
        lat, lon, alt = m.sim.autopilot.lla(np.array([e + 1.5 * WALL_M, n, 0.0]))
        m.sim.pilot.command(mavlink.MAV_CMD_USER_1, 3, 1, 0, 0, lat, lon, alt, component=191)
        nearest, highest = np.inf, 0.0
        while m.phase is not Phase.DESCEND:
            x, y, z = (float(v) for v in m.sim.vehicle.truth.pos_enu_m)
            if z < WALL_HIGH_M:
                aside = max(0.0, abs(y - n) - WALL_WIDE_M / 2)
                nearest = min(nearest, float(np.hypot(x - e - WALL_M, aside)))
            highest = max(highest, z)
            await asyncio.sleep(0.1)
        assert nearest > 1.5
        assert highest > WALL_HIGH_M

    mission.fly(script)
    assert not mission.companion.executive.tally.aborts
    assert mission.companion.sensing.specks.specks > 1000


@pytest.mark.long
def test_an_autopilot_that_is_not_set_up_is_landed_by_an_order_alone_until_it_is_set_right() -> None:
    """The order is carried out, and warned of; set right in the air, it lands by itself."""
    mission = Mission(seed=13, **brief(parameters={"GUID_TIMEOUT": 30.0}))

    async def script(m: Mission) -> None:
        assert m.sim.pilot is not None
        await m.until(lambda: bool(m.companion.mapping.latest.zones_seen))
        await m.until(lambda: m.height_m > 11)
        await asyncio.sleep(10)
        assert m.phase is Phase.IDLE
        assert "SLZ: GUID_TIMEOUT is 30, needs 0.5 to 5" in m.heard
        assert "SLZ: no landing by itself: GUID_TIMEOUT" in m.heard
        m.sim.pilot.command(mavlink.MAV_CMD_USER_1, 1, component=191)
        await m.until_phase(Phase.FINAL, 120)
        assert "SLZ: landing is at risk: GUID_TIMEOUT" in m.heard
        told = m.companion.deciding.fitness.summary()
        assert (told["read"], told["fit"]) == (True, False)
        assert [fault["name"] for fault in told["wrong"]] == ["GUID_TIMEOUT"]
        m.sim.pilot.set_mode(Mode.LOITER)
        await m.until(lambda: m.sim.autopilot.mode is Mode.LOITER and m.phase is Phase.IDLE)
        m.sim.autopilot.parameters["GUID_TIMEOUT"] = 3.0
        await asyncio.sleep(2)
        m.sim.pilot.set_mode(Mode.GUIDED)
        await m.until_phase(Phase.LANDED, 180)

    mission.fly(script)
    assert "SLZ: autopilot's parameters are right now" in mission.heard
    assert mission.companion.summary["autopilot_parameters"]["fit"]
    assert mission.touchdown_safe()


# Rally points after the companion died in flight: the autopilot's RTL lands on surveyed ground.


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
