"""A companion's link and services beside the simulator as a program, in real time, and a station's port."""

from __future__ import annotations

import asyncio
import contextlib
import json
import sys
from asyncio.subprocess import PIPE
from collections.abc import AsyncIterator, Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, cast

import params
from companion.flight.link.link import Link
from companion.flight.link.wire.signing import Signing
from companion.flight.mapping.latest_report import LatestReport
from companion.flight.services.services import Services
from companion.flight.services.settings import Settings
from companion.runtime.state_directory import StateDir
from tests.ports import free_port

STEP_S = 30.0


@dataclass
class Given:
    """Report that stays valid as long as it is given; None for none."""

    report: Any = None

    def valid(self, _at_ns: int) -> Any:
        return self.report


@dataclass
class Ship:
    """What flies: the link and services of a companion, and where a ground station connects.

    station_port: TCP, of the simulator, which forwards. link_port: UDP, of the companion itself. state: what
    it remembers. latest: the report of its map.
    """

    link: Link
    settings: Settings
    services: Services
    station_port: int
    link_port: int
    state: StateDir
    latest: Given


@contextlib.asynccontextmanager
async def ship(
    state: Path, *simulator: str, signing: Signing | None = None, **values: object
) -> AsyncIterator[Ship]:
    """Run `python -m sitl` with a companion's link on one wire and a server for a station on another."""
    port = free_port()
    process = await asyncio.create_subprocess_exec(
        sys.executable, "-m", "sitl", "--scene", "plain", "--lidar", "none", *simulator,
        "--mavlink", f"udpout:127.0.0.1:{port}", "--mavlink", "tcpin:127.0.0.1:0",
        stdout=PIPE,
    )  # fmt: skip
    try:
        assert process.stdout is not None
        async with asyncio.timeout(STEP_S):
            ready = json.loads(await process.stdout.readline())
        remembered = StateDir(state)
        settings = Settings(params.build(values), remembered)
        link = Link(f"udpin:127.0.0.1:{port}", settings.live, signing)
        latest = Given()
        services = Services(link, settings, signing, remembered, cast(LatestReport, latest))
        tasks = [asyncio.create_task(link.run()), asyncio.create_task(services.run())]
        try:
            await until(lambda: link.connected)
            station_port = int(ready["mavlink"][1].rpartition(":")[2])
            yield Ship(link, settings, services, station_port, port, remembered, latest)
        finally:
            await link.close()
            tasks[1].cancel()
            await asyncio.gather(*tasks, return_exceptions=True)
    finally:
        if process.returncode is None:
            process.kill()
        await process.wait()


async def until(condition: Callable[[], object], seconds: float = STEP_S) -> None:
    """Wait until something is so."""
    async with asyncio.timeout(seconds):
        while not condition():
            await asyncio.sleep(0.02)
