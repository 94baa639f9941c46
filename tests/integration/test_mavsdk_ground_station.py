"""MAVSDK, an independent ground station, flies the simulator as a user would start it."""

from __future__ import annotations

import asyncio
import contextlib
import json
import math
import signal
import sys
from asyncio.subprocess import PIPE, Process
from collections.abc import AsyncGenerator, AsyncIterator, Callable
from pathlib import Path
from typing import Any, TypeVar

import pytest
from mavsdk.asyncio import Autopilot, ComponentType, Configuration, Mavsdk, System
from mavsdk.asyncio.plugins.action import ActionAsync
from mavsdk.asyncio.plugins.param import ParamAsync
from mavsdk.asyncio.plugins.telemetry import LandedState, TelemetryAsync

from tests.ports import free_port

pytestmark = pytest.mark.realtime

ORIGIN = (47.4, 8.5, 500.0)
HEIGHT_M = 5.0
STEP_S = 30.0

T = TypeVar("T")


@contextlib.asynccontextmanager
async def simulator(url: str, truth: Path) -> AsyncIterator[tuple[Process, str]]:
    """Run `python -m sitl`; give the process and the address it says it serves."""
    process = await asyncio.create_subprocess_exec(
        sys.executable, "-m", "sitl", "--scene", "plain", "--lidar", "none", "--speedup", "3",
        "--origin", ",".join(map(str, ORIGIN)), "--mavlink", url, "--truth", str(truth),
        stdout=PIPE,
    )  # fmt: skip
    try:
        assert process.stdout is not None
        async with asyncio.timeout(STEP_S):
            ready = json.loads(await process.stdout.readline())
        assert ready["ready"] is True
        yield process, ready["mavlink"][0]
    finally:
        if process.returncode is None:
            process.kill()
        await process.wait()


@contextlib.asynccontextmanager
async def station(url: str) -> AsyncIterator[System]:
    """Give the first autopilot that MAVSDK finds at an address."""
    async with Mavsdk(Configuration.create_with_component_type(ComponentType.GROUND_STATION)) as made:
        await made.add_any_connection(url)
        system = await made.first_autopilot(timeout_s=STEP_S)
        assert system is not None, f"no autopilot at {url}"
        yield system


async def first(updates: AsyncGenerator[T, None], wanted: Callable[[T], object]) -> T:
    """Return the first update that is wanted."""
    async with asyncio.timeout(STEP_S), contextlib.aclosing(updates):
        async for update in updates:
            if wanted(update):
                return update
    raise AssertionError("the updates ended")


async def fly(system: System) -> None:
    """Arm, take off, hover and land."""
    action, telemetry = ActionAsync(system), TelemetryAsync(system)
    await first(telemetry.subscribe_health(), lambda h: h.is_armable and h.is_global_position_ok)
    await first(telemetry.subscribe_health(), lambda h: h.is_home_position_ok)
    ground = await first(telemetry.subscribe_position(), lambda _: True)
    assert (ground.latitude_deg, ground.longitude_deg) == pytest.approx(ORIGIN[:2], abs=1e-4)
    await action.set_takeoff_altitude(HEIGHT_M)
    await action.arm()
    await first(telemetry.subscribe_armed(), bool)
    await action.takeoff()
    top = await first(telemetry.subscribe_position(), lambda p: p.relative_altitude_m > HEIGHT_M - 0.5)
    assert top.absolute_altitude_m - ground.absolute_altitude_m == pytest.approx(HEIGHT_M, abs=1.0)
    await first(telemetry.subscribe_landed_state(), lambda s: s == LandedState.IN_AIR)
    await action.land()
    await first(telemetry.subscribe_landed_state(), lambda s: s == LandedState.ON_GROUND)
    await first(telemetry.subscribe_armed(), lambda armed: not armed)


@pytest.mark.parametrize("kind", ["tcp", "udp"])
async def test_mavsdk_arms_takes_off_and_lands(kind: str, tmp_path: Path) -> None:
    port = free_port()
    url = "tcpin:127.0.0.1:0" if kind == "tcp" else f"udpout:127.0.0.1:{port}"
    async with simulator(url, tmp_path) as (process, served):
        port = int(served.rpartition(":")[2])
        async with station(f"{'tcpout' if kind == 'tcp' else 'udpin'}://127.0.0.1:{port}") as system:
            assert await system.get_system_id() == 1
            assert await system.autopilot_type() == Autopilot.ARDUPILOT
            await fly(system)
        process.send_signal(signal.SIGTERM)
        async with asyncio.timeout(STEP_S):
            assert await process.wait() == 0
    flight: dict[str, Any] = json.loads((tmp_path / "flight.json").read_text("utf-8"))
    touch = flight["touchdown"]
    assert [m["mode"] for m in flight["modes"]] == ["GUIDED", "LAND"]
    assert max(p["u"] for p in flight["trajectory"]) == pytest.approx(HEIGHT_M, abs=1.0)
    assert math.hypot(touch["e"], touch["n"]) < 2.0
    assert 0 < touch["sink_ms"] < 1.0
    assert not flight["crashed"]


async def test_mavsdk_reads_and_sets_parameters(tmp_path: Path) -> None:
    async with (
        simulator("tcpin:127.0.0.1:0", tmp_path) as (_, served),
        station(f"tcpout://127.0.0.1:{served.rpartition(':')[2]}") as system,
    ):
        params = ParamAsync(system)
        assert await params.get_param_float("WPNAV_SPEED") == 500.0
        await params.set_param_float("WPNAV_SPEED", 300.0)
        assert await params.get_param_float("WPNAV_SPEED") == 300.0
