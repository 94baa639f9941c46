"""The subscription of an external odometry, over a real network."""

from __future__ import annotations

import asyncio
import time
from dataclasses import replace

import pytest

import params
from companion.flight.app import Companion
from companion.flight.fusion.external_odometry.odometry_topic import OdometryTopic
from companion.flight.rmw.zenoh_url import ZenohUrl
from companion.flight.ros2.ros_node import DIAGNOSTICS
from companion.flight.sensing import Sources
from companion.runtime.errors import UsageError
from tests.unit.companion.flight.fusion.external_odometry.odometry_messages import Told
from tests.unit.companion.flight.rmw.test_message_types import PUBLISHED
from tests.unit.companion.flight.rmw.zenoh_network import Client, router, until
from tests.unit.companion.flight.ros2.independent_decoders import decoded

TYPE = "nav_msgs::msg::dds_::Odometry_"
HASH = f"RIHS01_{PUBLISHED['nav_msgs/msg/Odometry']}"
KEY = f"7/lio/odometry/{TYPE}/{HASH}"
TOPIC = OdometryTopic("/lio/odometry")


def made(ros2: ZenohUrl | None, odometry: str = "map") -> Companion:
    return Companion(
        "udpin:127.0.0.1:14550",
        Sources("livox:127.0.0.1:56301", ros2=ros2, odometry=TOPIC),
        params.load("quadcopter", [f"odometry={odometry}"]),
        auto=False,
    )


def told(number: int, **more: object) -> Told:
    message = Told(time.time_ns(), (0.1 * number, 0.0, 0.0), number=number)
    return replace(message, **more)  # type: ignore[arg-type]


async def test_messages_of_a_node_are_taken_and_the_others_counted_in_the_diagnostics() -> None:
    with router() as endpoint:
        companion = made(ZenohUrl(endpoint, 7))
        subscription, node = companion.sensing.ros_odometry, companion.telling.ros_node
        assert subscription is not None
        assert node is not None
        assert companion.sensing.odometry is not None
        tasks = [asyncio.create_task(part.run()) for part in (node, subscription)]
        await until(node.session.is_connected)
        client = Client(endpoint)
        await until(
            lambda: any(TYPE in token and "/MS/" in token for token in client.tokens("@ros2_lv/7/**"))
        )
        (token,) = (one for one in client.tokens("@ros2_lv/7/*/*/*/MS/**") if TYPE in one)
        assert token.endswith(f"/slz/%lio%odometry/{TYPE}/{HASH}/2::,20:,:,:,,")  # best effort takes all
        bad = (told(2, xyzw=(0.0, 0.0, 0.0, 2.0)), told(3, position_m=(float("nan"), 0.0, 0.0)))
        for message in (told(1), *bad, told(4, gid=b"another publisher"[:16]), told(5, stamp_ns=5), told(8)):
            client.session.put(KEY, message.payload(), attachment=message.attachment())
        client.session.put(KEY, told(9).payload()[:-9], attachment=told(9).attachment())
        client.session.put(f"7/lio/odometry/{TYPE}/RIHS01_{'0' * 64}", b"", attachment=b"")
        await until(lambda: subscription.statistics()["wrong_type"])
        await until(lambda: companion.sensing.odometry.statistics()["malformed"])
        client.listen(f"7{DIAGNOSTICS.name}/**")
        parts = {one.name: one for one in decoded(await client.next_of(DIAGNOSTICS.name)).status}
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)
        node.close()
        client.close()
        companion.mapping.worker.close()
    status = parts["slz: odometry"]
    values = {pair.key: pair.value for pair in status.values}
    assert status.level == 1
    assert values["topic"] == "/lio/odometry"
    counts = {name: int(values[name]) for name in ("messages", "lost_messages", "wrong_type", "overrun")}
    assert counts == {"messages": 2, "lost_messages": 3, "wrong_type": 1, "overrun": 0}
    dropped = ("malformed", "not_unit", "not_finite", "foreign", "other_clock")
    assert {name: int(values[name]) for name in dropped} == dict.fromkeys(dropped, 1)


def test_a_topic_needs_a_node_and_a_use() -> None:
    with pytest.raises(UsageError, match="'/lio/odometry' needs --ros2"):
        made(None)
    with pytest.raises(UsageError, match="used nowhere, as odometry is off: add --set odometry=map"):
        made(ZenohUrl(), "off")
