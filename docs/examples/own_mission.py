"""A mission of one's own by MAVSDK, that comes down where slz says that it can.

It starts the simulator and the companion; on a vehicle they run already: then only `mission` is yours.
"""

from __future__ import annotations

import asyncio
import contextlib
import json
import socket
import sys
import urllib.request
from asyncio.subprocess import DEVNULL, PIPE, Process
from collections.abc import AsyncGenerator, AsyncIterator, Awaitable, Callable
from typing import Any, TypeVar

from mavsdk.asyncio import ComponentType, Configuration, Mavsdk, System
from mavsdk.asyncio.plugins.action import ActionAsync, ActionError
from mavsdk.asyncio.plugins.param import ParamAsync, ParamError, ProtocolVersion
from mavsdk.asyncio.plugins.telemetry import LandedState, TelemetryAsync

T = TypeVar("T")
COMPANION = 191
HEIGHT_M = 20.0


def free_port(kind: socket.SocketKind) -> int:
    """Return a port that is free now."""
    with socket.socket(socket.AF_INET, kind) as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


@contextlib.asynccontextmanager
async def program(*words: str, says_ready: bool = False) -> AsyncIterator[Process]:
    """Run one of slz's programs beside this one, and end it."""
    stdout = PIPE if says_ready else DEVNULL
    process = await asyncio.create_subprocess_exec(sys.executable, "-m", *words, stdout=stdout)
    try:
        if process.stdout is not None and not await process.stdout.readline():
            raise RuntimeError(f"{words[0]} ended before it was ready")
        yield process
    finally:
        with contextlib.suppress(ProcessLookupError):
            process.terminate()
        await process.wait()


async def first(updates: AsyncGenerator[T, None], wanted: Callable[[T], object], limit_s: float = 60) -> T:
    """Return the first update that is wanted."""
    async with asyncio.timeout(limit_s), contextlib.aclosing(updates):
        async for update in updates:
            if wanted(update):
                return update
    raise ConnectionError("the vehicle's updates ended")


def fetch(url: str) -> Any:
    """Return a JSON document."""
    with urllib.request.urlopen(url, timeout=5) as answer:
        return json.load(answer)


async def zones(page: str, at_least: float, limit_s: float = 120) -> list[dict[str, Any]]:
    """Return the properties of the near zones so certain, the best first; wait for the first of them."""
    async with asyncio.timeout(limit_s):
        while True:
            with contextlib.suppress(OSError):  # not up yet
                found = await asyncio.to_thread(fetch, f"{page}/api/zones.geojson")
                near = [f["properties"] for f in found["features"] if f["properties"]["map"] == "near"]
                if not found["past"] and (sure := [z for z in near if z["certainty"] >= at_least]):
                    return sure
            await asyncio.sleep(1)


async def again(what: str, call: Callable[[], Awaitable[object]]) -> None:
    """Do what may be refused for a moment, or whose answer was lost on the way."""
    for _ in range(10):
        try:
            await call()
            return
        except (ActionError, ParamError) as error:
            print(f"{what}: {error}")
            await asyncio.sleep(1)
    raise RuntimeError(f"{what} is refused: the ground station shows why")


async def mission(system: System, page: str) -> dict[str, Any]:
    """Take off, fly a leg, and land in the largest of the zones that are certain."""
    action, telemetry, param = ActionAsync(system), TelemetryAsync(system), ParamAsync(system)
    with contextlib.suppress(ParamError):  # says UNKNOWN in 4.1 and does it
        await param.select_component(COMPANION, ProtocolVersion.V1)
    await first(telemetry.subscribe_health(), lambda h: h.is_armable and h.is_home_position_ok)
    home = await first(telemetry.subscribe_position(), lambda _: True)
    await action.set_takeoff_altitude(HEIGHT_M)
    await again("arm", action.arm)
    await again("take off", action.takeoff)
    await first(telemetry.subscribe_position(), lambda p: p.relative_altitude_m > HEIGHT_M - 0.2)

    # The leg: 30 m to the north, as any mission would. The companion maps meanwhile, and commands nothing.
    north = home.latitude_deg + 30 / 111_000
    await action.goto_location(north, home.longitude_deg, home.absolute_altitude_m + HEIGHT_M, 0.0)
    await first(telemetry.subscribe_position(), lambda p: abs(p.latitude_deg - north) < 2 / 111_000)

    zone = max(await zones(page, at_least=0.9), key=lambda zone: float(zone["area_m2"]))
    print(f"landing in zone {zone['id']}: {zone['area_m2']:.0f} m2, certainty {zone['certainty']:.2f}")
    # Its best point comes under watch; then the hand-over: land at the point under watch.
    await again("select", lambda: param.set_param_int("SLZ_SELECT", zone["id"]))
    await again("land", lambda: param.set_param_int("SLZ_DO", 6))
    await first(telemetry.subscribe_landed_state(), lambda s: s == LandedState.ON_GROUND, limit_s=180)
    touchdown = await first(telemetry.subscribe_position(), lambda _: True)
    return {"ordered_zone": zone["id"], "lat": touchdown.latitude_deg, "lon": touchdown.longitude_deg}


async def main() -> None:
    """Fly it in the simulator."""
    ours, theirs, page = (free_port(socket.SOCK_STREAM) for _ in range(3))
    lidar = free_port(socket.SOCK_DGRAM)
    sim = (
        *("sitl", "--scene", "plain", "--speedup", "1", "--point-rate", "50000"),
        *("--lidar-to", f"127.0.0.1:{lidar}"),
        *("--mavlink", f"tcpin:127.0.0.1:{ours}", "--mavlink", f"tcpin:127.0.0.1:{theirs}"),
    )
    run = (
        *(
            "companion.cli",
            "run",
            "--mavlink",
            f"tcp:127.0.0.1:{ours}",
            "--lidar",
            f"livox:127.0.0.1:{lidar}",
        ),
        *("--dashboard", f"127.0.0.1:{page}"),
    )
    station = Configuration.create_with_component_type(ComponentType.GROUND_STATION)
    async with program(*sim, says_ready=True), program(*run), Mavsdk(station) as ground:
        await ground.add_any_connection(f"tcpout://127.0.0.1:{theirs}")
        system = await ground.first_autopilot(timeout_s=60)
        if system is None:
            raise ConnectionError("no autopilot was heard")
        print(json.dumps(await mission(system, f"http://127.0.0.1:{page}")))


if __name__ == "__main__":
    asyncio.run(main())
