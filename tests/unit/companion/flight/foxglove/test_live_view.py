"""Foxglove's live view: the recording's topics for the eye, and no others."""

import asyncio
import contextlib
import json
import struct
from typing import Any

import numpy as np
import pytest
from websockets.asyncio.client import connect
from websockets.typing import Subprotocol

import params
from companion.flight.app import Companion
from companion.flight.foxglove.live_view import SHOWN, LiveView
from companion.flight.geometry.pose import Pose
from companion.flight.recorder import topics as display
from companion.flight.sensing import Sources
from companion.runtime.errors import UsageError
from tests.unit.companion.flight.landing.flight import FRAME, Flight, zone

SECOND = 1_000_000_000


async def test_an_engineer_s_viewer_gets_the_zones_in_the_recording_s_schema() -> None:
    made = Companion("udpin:127.0.0.1:14550", Sources("livox:127.0.0.1:56301"), params.load(), auto=False)
    live = LiveView(made.telling.view, 0)
    report = Flight([zone(1, 5.0, 5.0)]).situation().report
    assert report is not None
    topics: dict[str, dict[str, Any]] = {}
    url = f"ws://127.0.0.1:{live.port}"
    async with connect(url, subprotocols=[Subprotocol("foxglove.sdk.v1")], proxy=None) as viewer:
        async with asyncio.timeout(10):
            while set(topics) < SHOWN:
                message = json.loads(await viewer.recv())
                topics |= {channel["topic"]: channel for channel in message.get("channels", ())}
            assert set(topics) == SHOWN
            assert topics["/zones"]["schemaName"] == "foxglove.SceneUpdate"
            wanted = {"id": 1, "channelId": topics["/zones/geojson"]["id"]}
            await viewer.send(json.dumps({"op": "subscribe", "subscriptions": [wanted]}))
            data: str | bytes = ""
            while not isinstance(data, bytes):
                live.use_report(report)
                try:
                    data = await asyncio.wait_for(viewer.recv(), 0.2)
                except TimeoutError:
                    continue
        assert b"FeatureCollection" in data
    await asyncio.to_thread(live.close)
    made.mapping.worker.close()


async def test_a_port_in_use_is_said_in_one_line() -> None:
    made = Companion("udpin:127.0.0.1:14550", Sources("livox:127.0.0.1:56301"), params.load(), auto=False)
    live = LiveView(made.telling.view, 0)
    with pytest.raises(UsageError, match="--foxglove"):
        LiveView(made.telling.view, live.port)
    await asyncio.to_thread(live.close)
    made.mapping.worker.close()


async def test_the_vehicle_s_place_is_shown_ten_times_a_second_at_most(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    clock = [10 * SECOND]
    monkeypatch.setattr("companion.flight.foxglove.live_view.now_ns", lambda: clock[0])
    made = Companion("udpin:127.0.0.1:14550", Sources("livox:127.0.0.1:56301"), params.load(), auto=False)
    live = LiveView(made.telling.view, 0)

    def fly(east_m: float, after_s: float) -> bytes:
        """Show a place so long after the last; return what a message about it holds."""
        clock[0] += round(after_s * SECOND)
        place = np.array([east_m, 0.0, 20.0])
        live.pose(Pose(clock[0], place, np.zeros(3), np.array([1.0, 0.0, 0.0, 0.0]), 0), FRAME)
        return struct.pack("<d", FRAME.lla(place)[1])

    url = f"ws://127.0.0.1:{live.port}"
    async with connect(url, subprotocols=[Subprotocol("foxglove.sdk.v1")], proxy=None) as viewer:
        async with asyncio.timeout(10):
            topics: dict[str, int] = {}
            while display.FIX not in topics:
                message = json.loads(await viewer.recv())
                topics |= {channel["topic"]: channel["id"] for channel in message.get("channels", ())}
            wanted = {"id": 1, "channelId": topics[display.FIX]}
            await viewer.send(json.dumps({"op": "subscribe", "subscriptions": [wanted]}))
            heard: str | bytes = ""
            while not isinstance(heard, bytes):
                first = fly(0.0, 1.0)
                with contextlib.suppress(TimeoutError):
                    heard = await asyncio.wait_for(viewer.recv(), 0.2)
            assert first in heard
            fly(100.0, 0.05)
            second = fly(200.0, 0.06)
            while first in heard:
                data = await viewer.recv()
                assert isinstance(data, bytes)
                heard = data
        assert second in heard
    await asyncio.to_thread(live.close)
    made.mapping.worker.close()
