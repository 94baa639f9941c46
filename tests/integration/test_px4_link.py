"""The link with a PX4: no request that it does not support, and immediate detection of its mode."""

from __future__ import annotations

import asyncio

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from tests.integration.link_bench import autopilot_over_udp, running, until, virtually
from tests.integration.px4_bench import OFFBOARD, Px4
from tests.ports import free_port

INTERVAL = mavlink.MAV_CMD_SET_MESSAGE_INTERVAL


@pytest.mark.parametrize("offers_mode", [True, False])
def test_px4_refuses_at_most_one_request_once(offers_mode: bool) -> None:
    async def flight() -> None:
        port = free_port()
        async with (
            running(f"udpin:127.0.0.1:{port}") as link,
            autopilot_over_udp(port, Px4, offers_mode=offers_mode) as autopilot,
        ):
            await until(lambda: link.connected)
            await asyncio.sleep(60)
            asked = [int(m.param1) for m in autopilot.heard("COMMAND_LONG") if m.command == INTERVAL]
            assert mavlink.MAVLINK_MSG_ID_HEARTBEAT not in asked
            assert asked.count(436) == 1
            statistics = link.statistics()
            assert statistics.missing == ()
            assert statistics.refused == (() if offers_mode else ("CURRENT_MODE",))
            assert statistics.unknown == statistics.bad == 0
            assert link.vehicle.mode == "AUTO.LOITER"

    virtually(flight)


@pytest.mark.parametrize(("offers_mode", "seconds"), [(True, 0.6), (False, 1.1)])
def test_a_change_of_the_mode_is_seen_as_soon_as_it_is_told(offers_mode: bool, seconds: float) -> None:
    async def flight() -> None:
        port = free_port()
        async with (
            running(f"udpin:127.0.0.1:{port}") as link,
            autopilot_over_udp(port, Px4, offers_mode=offers_mode) as autopilot,
        ):
            await until(lambda: link.connected)
            await asyncio.sleep(10)
            autopilot.mode = OFFBOARD
            await until(lambda: link.vehicle.guided, seconds)

    virtually(flight)
