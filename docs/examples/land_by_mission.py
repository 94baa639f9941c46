"""How does my own mission land where slz says that it can? With MAVSDK, beside `slz sim` and `slz run`."""

import asyncio
import contextlib
import sys

from mavsdk.asyncio import ComponentType, Configuration, Mavsdk
from mavsdk.asyncio.plugins.action import ActionAsync
from mavsdk.asyncio.plugins.param import ParamAsync, ParamError, ProtocolVersion
from mavsdk.asyncio.plugins.telemetry import LandedState, TelemetryAsync


async def first(updates, wanted=lambda update: True):
    return await anext(update async for update in updates if wanted(update))


async def main(url):
    async with Mavsdk(Configuration.create_with_component_type(ComponentType.GROUND_STATION)) as station:
        await station.add_any_connection(url)
        vehicle = await station.first_autopilot(timeout_s=60)
        action, telemetry, slz = ActionAsync(vehicle), TelemetryAsync(vehicle), ParamAsync(vehicle)
        await first(telemetry.subscribe_health(), lambda health: health.is_armable)
        home = await first(telemetry.subscribe_position())
        await action.set_takeoff_altitude(20.0)
        await action.arm()
        await action.takeoff()
        await first(telemetry.subscribe_position(), lambda now: now.relative_altitude_m > 19.8)
        north = home.latitude_deg + 30 / 111_000  # the mission: a leg of 30 m; slz maps, and commands nothing
        await action.goto_location(north, home.longitude_deg, home.absolute_altitude_m + 20.0, 0.0)
        await first(telemetry.subscribe_position(), lambda now: abs(now.latitude_deg - north) < 2 / 111_000)

        with contextlib.suppress(ParamError):  # MAVSDK 4.1 says UNKNOWN, and selects it
            await slz.select_component(191, ProtocolVersion.V1)
        await slz.set_param_int("SLZ_DO", 1)  # from here on slz flies: land at the best zone
        await first(telemetry.subscribe_landed_state(), lambda state: state == LandedState.ON_GROUND)
        there = await first(telemetry.subscribe_position())
        print(f"landed {(there.latitude_deg - home.latitude_deg) * 111_000:.0f} m north of home")


asyncio.run(main(sys.argv[1] if len(sys.argv) > 1 else "udpin://127.0.0.1:14550"))
