"""Foxglove's live view: the recording's topics for the eye, and no others."""

import asyncio
import json
from typing import Any

import pytest
from websockets.asyncio.client import connect
from websockets.typing import Subprotocol

import params
from companion.app import Companion
from companion.errors import UsageError
from companion.foxglove.live import SHOWN, LiveView
from tests.unit.companion.landing.flight import Flight, zone


async def test_an_engineer_s_viewer_gets_the_zones_in_the_recording_s_schema() -> None:
    made = Companion("udpin:127.0.0.1:14550", "livox:127.0.0.1:56301", params.load(), auto=False)
    live = LiveView(made, 0)
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
                live.report(report)
                try:
                    data = await asyncio.wait_for(viewer.recv(), 0.2)
                except TimeoutError:
                    continue
        assert b"FeatureCollection" in data
    await asyncio.to_thread(live.close)
    made.worker.close()


async def test_a_port_in_use_is_said_in_one_line() -> None:
    made = Companion("udpin:127.0.0.1:14550", "livox:127.0.0.1:56301", params.load(), auto=False)
    live = LiveView(made, 0)
    with pytest.raises(UsageError, match="--foxglove"):
        LiveView(made, live.port)
    await asyncio.to_thread(live.close)
    made.worker.close()
