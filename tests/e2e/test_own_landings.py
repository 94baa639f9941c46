"""Landings that the autopilot makes by itself: led to safe ground, by a target alone."""

from __future__ import annotations

import asyncio

import numpy as np
import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from companion.flight.landing.situation import Phase
from sitl.autopilot.modes import Mode
from tests.e2e.harness import Mission

pytestmark = pytest.mark.long

HEIGHT_M = 18.0
ONLY_PLACE = 0b110111111000  # type_mask of a position target


async def fly_over(mission: Mission, east_m: float, north_m: float) -> None:
    """Let the pilot fly to a place from the start (m), and wait until the map knows it."""
    pilot, autopilot, vehicle = mission.sim.pilot, mission.sim.autopilot, mission.sim.vehicle
    assert pilot is not None
    await mission.until(lambda: pilot.done and mission.height_m > HEIGHT_M - 2)
    there = vehicle.truth.pos_enu_m + np.array([east_m, north_m, 0.0])
    lat, lon, alt = autopilot.lla(there)
    pilot.send(
        mavlink.MAVLink_set_position_target_global_int_message(
            0, 1, 1, mavlink.MAV_FRAME_GLOBAL_INT, ONLY_PLACE, round(lat * 1e7), round(lon * 1e7), alt,
            *[0.0] * 8,
        )
    )  # fmt: skip
    await mission.until(lambda: bool(np.hypot(*(vehicle.truth.pos_enu_m - there)[:2]) < 0.7))
    await asyncio.sleep(4.0)


def texts(mission: Mission, part: str) -> list[str]:
    return [text for text in mission.heard if part in text]


def test_a_land_of_the_pilots_beside_a_kerb_ends_on_safe_ground() -> None:
    mission = Mission("streets", auto=False, assist="offer")

    async def script(m: Mission) -> None:
        await fly_over(m, 0.0, 12.0)
        assert m.sim.pilot is not None
        m.sim.pilot.set_mode(Mode.LAND)
        await m.until(lambda: m.sim.autopilot.mode is Mode.LAND)
        await m.until(lambda: not m.sim.autopilot.armed)
        await asyncio.sleep(0.5)
        assert m.phase is Phase.IDLE

    mission.fly(script)
    assert mission.touchdown_safe()
    assert texts(mission, "LAND: led")
    assist = mission.companion.summary["assist"]
    assert assist["led"] == 1
    assert assist["off_m"][0] < 0.3


def test_a_lost_transmitters_rtl_ends_beside_what_stands_at_home() -> None:
    """The stands are lower than RTL_ALT; a car has been parked where the vehicle took off."""
    mission = Mission("stadium", auto=False, assist="offer", simulated={"parameters": {"FS_THR_ENABLE": 1}})

    async def script(m: Mission) -> None:
        await fly_over(m, 6.0, 6.0)
        m.sim.autopilot.receiver.transmitting = False
        await m.until(lambda: m.sim.autopilot.mode is Mode.RTL)
        await m.until(lambda: not m.sim.autopilot.armed)

    mission.fly(script)
    assert mission.touchdown_safe()
    assert texts(mission, "RTL: ")
