"""The circle around the landing point reaches a station through the autopilot, which does not act on it."""

from __future__ import annotations

import asyncio
from pathlib import Path
from typing import Any

import pytest
from pymavlink import mavutil

from companion.flight.outputs.map_circle import MapCircle, MapCircleStream
from companion.runtime.clock import now_ns
from tests.integration.service_bench import STEP_S, ship

pytestmark = pytest.mark.realtime


def _drawn(port: int) -> tuple[float, float, float, int]:
    """Return latitude, longitude and radius as a station reads them, and the sender's component."""
    wire: Any = mavutil.mavlink_connection(f"tcp:127.0.0.1:{port}", source_system=254)
    try:
        heard = wire.recv_match(type="ORBIT_EXECUTION_STATUS", blocking=True, timeout=STEP_S)
        assert heard is not None
        return heard.x / 1e7, heard.y / 1e7, abs(heard.radius), heard.get_srcComponent()
    finally:
        wire.close()


async def test_a_station_behind_the_autopilot_can_draw_it(tmp_path: Path) -> None:
    async with ship(tmp_path) as flown:
        before = flown.link.vehicle
        drawing = asyncio.create_task(asyncio.to_thread(_drawn, flown.station_port))
        while not drawing.done():
            circle = MapCircleStream().message(MapCircle(47.4001, 8.5002, 500.0, 4.5), now_ns())
            flown.link.send(circle)
            await asyncio.sleep(0.2)
        after = flown.link.vehicle
    assert await drawing == (pytest.approx(47.4001), pytest.approx(8.5002), 4.5, 191)
    assert (after.mode, after.armed) == (before.mode, before.armed)
