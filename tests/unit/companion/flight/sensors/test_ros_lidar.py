"""The LiDAR of a ROS driver, over a real network."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager

import numpy as np
import pytest

from companion.flight.rmw.message_types import message_types
from companion.flight.rmw.ros_session import RosSession
from companion.flight.rmw.zenoh_url import ZenohUrl
from companion.flight.sensors.lidar_url import Lidar, open_lidar
from companion.flight.sensors.packet_stream import Batch
from companion.flight.sensors.returns import Returns
from companion.runtime.errors import UsageError
from params import Parameters
from tests.unit.companion.flight.rmw.zenoh_network import Client, router, until
from tests.unit.companion.flight.sensors.decoders.clouds import CLOUD, Driver

DRIVER = Driver()
KEY = f"0/livox/lidar/sensor_msgs::msg::dds_::PointCloud2_/{message_types().hash(CLOUD)}"


@asynccontextmanager
async def listening(url: str, batches: list[Returns]) -> AsyncIterator[tuple[Lidar, Client]]:
    """Open a LiDAR, and a driver's connection to the same router."""
    with router() as endpoint:
        session = RosSession(ZenohUrl(endpoint))
        lidar = open_lidar(url, Parameters(), batches.append, ros=session)
        tasks = [asyncio.create_task(part.run()) for part in (session, lidar)]
        await until(session.is_connected)
        client = Client(endpoint)
        try:
            yield lidar, client
        finally:
            for task in tasks:
                task.cancel()
            await asyncio.gather(*tasks, return_exceptions=True)
            client.close()
            session.close()


async def test_returns_of_a_driver_arrive_and_are_recorded() -> None:
    batches: list[Returns] = []
    recorded: list[Batch] = []
    async with listening("ros2:/livox/lidar", batches) as (lidar, client):
        lidar.stream.batches.subscribe(recorded.append)
        for number in range(1, 13):
            client.session.put(KEY, DRIVER.payload(number), attachment=DRIVER.attachment(number))
            await until(lambda number=number: _seen(lidar) == number)
        statistics = lidar.statistics()
    assert len(batches) == 2
    assert (statistics["packets"], statistics["judged"], statistics["returns"]) == (2, 10, 200)
    assert (np.diff(batches[0].stamp_ns) == 1_000_000).all()
    assert [packet for batch in recorded for _, packet in batch] == [DRIVER.packet(11), DRIVER.packet(12)]
    assert lidar.last_arrival_ns is not None
    assert lidar.last_arrival_ns >= batches[1].stamp_ns[-1]


async def test_malformed_and_foreign_clouds_are_counted_with_their_reason() -> None:
    batches: list[Returns] = []
    other = DRIVER.but(gid=b"another driver 2")
    async with listening("ros2:/livox/lidar?instant", batches) as (lidar, client):
        client.session.put(KEY, DRIVER.payload(1), attachment=DRIVER.attachment(1))
        await until(lambda: len(batches) == 1)
        client.session.put(KEY, DRIVER.payload(2)[:-9], attachment=DRIVER.attachment(2))
        client.session.put(KEY, DRIVER.payload(2))
        client.session.put(KEY, other.payload(3), attachment=other.attachment(3))
        client.session.put(KEY.rpartition("/")[0] + "/RIHS01_0", b"", attachment=b"")
        await until(lambda: lidar.statistics()["foreign"])
        await until(lambda: lidar.statistics()["wrong_type"])
        statistics = lidar.statistics()
    assert (statistics["malformed"], statistics["foreign"], statistics["wrong_type"]) == (2, 1, 1)
    assert len(batches) == 1


async def test_a_busy_loop_keeps_the_last_five_clouds() -> None:
    batches: list[Returns] = []
    async with listening("ros2:/livox/lidar?instant", batches) as (lidar, client):
        for number in range(1, 9):  # the loop does not turn meanwhile
            client.session.put(KEY, DRIVER.payload(number), attachment=DRIVER.attachment(number))
        while lidar.statistics()["overrun"] != 3:
            pass
        assert not batches
        await until(lambda: len(batches) == 5)
        assert lidar.statistics()["lost_packets"] == 0  # not known before the first


@pytest.mark.parametrize(
    "url",
    ["ros2:", "ros2:points", "ros2:/", "ros2:/a//b", "ros2:/a?instantly", "ros2:/a b", "ros2:/1a", "ros2:/*"],
)
def test_a_wrong_topic_is_said_in_one_line(url: str) -> None:
    with pytest.raises(UsageError, match="is no topic"):
        open_lidar(url, Parameters(), print, ros=RosSession(ZenohUrl()))


def test_a_topic_needs_a_node() -> None:
    with pytest.raises(UsageError, match="needs --ros2"):
        open_lidar("ros2:/points", Parameters(), print)


def _seen(lidar: Lidar) -> int:
    statistics = lidar.statistics()
    return int(statistics["packets"] or 0) + int(statistics["judged"] or 0)
