"""MAVSDK and MAVProxy, as ground stations, see our rally points beside their own."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from mavsdk.asyncio import ComponentType, Configuration, Mavsdk
from mavsdk.asyncio.plugins.mission_raw import MissionItem, MissionRawAsync

from slz import LandingPoint, LocalFrame, SurfaceHere
from tests.integration.mavproxy import Station
from tests.integration.service_bench import STEP_S, Ship, ship, until

pytestmark = pytest.mark.realtime

ORIGIN = (47.4, 8.5, 500.0)
FLYING = (
    "--origin",
    ",".join(map(str, ORIGIN)),
    "--pilot",
    "takeoff",
    "--takeoff-alt",
    "10",
    "--speedup",
    "4",
)
OWN = (474_010_000, 85_010_000, 40.0)


def report(*east_m: float) -> Any:
    """Return a report with a zone at each of these places east of the origin."""
    places = [np.array([east, 0.0, 0.0]) for east in east_m]
    zones = tuple(
        SimpleNamespace(best=LandingPoint(at, 4.0, 3.0, 1.0, 0.99, surface=SurfaceHere())) for at in places
    )
    return SimpleNamespace(frame=LocalFrame(*ORIGIN), near=SimpleNamespace(zones=zones))


async def settled(flown: Ship, uploads: int) -> None:
    rally = flown.services.rally
    await until(lambda: rally.uploads >= uploads and not rally.busy)


async def test_mavsdk_s_own_point_stays_and_ours_are_read_back(tmp_path: Path) -> None:
    async with ship(tmp_path, *FLYING, rally="on") as flown:
        async with Mavsdk(Configuration.create_with_component_type(ComponentType.GROUND_STATION)) as station:
            await station.add_any_connection(f"tcpout://127.0.0.1:{flown.station_port}")
            system = await station.first_autopilot(timeout_s=STEP_S)
            assert system is not None
            raw = MissionRawAsync(system)
            own = MissionItem(0, 3, 5100, 0, 1, 0.0, 0.0, 0.0, 0.0, *OWN, 2)
            await raw.upload_rally_points([own])
            flown.latest.report = report(30.0, 60.0)
            await settled(flown, 1)
            items = await raw.download_rallypoints()
            assert [(i.command, i.frame) for i in items] == [(5100, 3)] * 3
            assert (items[0].x, items[0].y, items[0].z) == OWN
            assert all(i.z in (20.0, 21.0) for i in items[1:])  # above a home that is estimated
            assert items[1].x == pytest.approx(474_000_000, abs=3)
            assert items[2].y > items[1].y > 85_000_000
        assert len(flown.services.rally.ours) == 2
        assert len((tmp_path / "rally").read_text("ascii").splitlines()) == 2


async def test_mavproxy_lists_our_points(tmp_path: Path, mavproxy: Path) -> None:
    async with (
        ship(tmp_path, *FLYING, rally="on") as flown,
        Station.at(mavproxy, flown.station_port, tmp_path) as station,
    ):
        flown.latest.report = report(30.0, 60.0)
        await settled(flown, 1)
        await station.hears("Detected vehicle")
        await station.says("rally list")
        await station.hears("47.4")
        await station.hears("47.4")
