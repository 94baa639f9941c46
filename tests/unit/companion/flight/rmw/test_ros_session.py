"""The session over a real network: routers that are there, absent, late or gone."""

from __future__ import annotations

import asyncio
import socket
import threading
import time
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager

import pytest
import xxhash

from companion.flight.rmw.attachment import unpack
from companion.flight.rmw.message_types import message_types
from companion.flight.rmw.ros_session import RosSession
from companion.flight.rmw.ros_topic import LATCHED, SENSOR_DATA, Qos, Topic
from companion.flight.rmw.zenoh_url import ZenohUrl, parse_zenoh_url
from companion.runtime.errors import UsageError
from tests.ports import free_port
from tests.unit.companion.flight.rmw.zenoh_network import Client, router, until

CHATTER = Topic("/chatter", "std_msgs/msg/String", Qos(7))
LAST = Topic("/slz/last", "std_msgs/msg/String", LATCHED)
HEARD = Topic("/heard", "std_msgs/msg/String", SENSOR_DATA)
STRING = "RIHS01_df668c740482bbd48fb39d76a70dfd4bd59db1288021743503259e948f6b1a18"
KEY = f"7/chatter/std_msgs::msg::dds_::String_/{STRING}"
HEARD_KEY = "7/heard/std_msgs::msg::dds_::String_"


def text(said: str) -> bytes:
    return message_types().serialise(message_types().make("std_msgs/msg/String", said))


@asynccontextmanager
async def running(session: RosSession) -> AsyncIterator[RosSession]:
    task = asyncio.create_task(session.run())
    try:
        yield session
    finally:
        task.cancel()
        await asyncio.gather(task, return_exceptions=True)
        session.close()


async def test_the_graph_sees_node_publisher_and_subscription() -> None:
    with router() as endpoint:
        session = RosSession(ZenohUrl(endpoint, 7))
        publisher = session.advertise(CHATTER)
        session.subscribe(HEARD, lambda payload, attachment: None)
        async with running(session):
            await until(session.is_connected)
            client = Client(endpoint)
            await until(lambda: len(client.tokens("@ros2_lv/7/**")) == 3)  # they follow the connection
            tokens = client.tokens("@ros2_lv/7/**")
            client.close()
    (zenoh_id,) = {token.split("/")[2] for token in tokens}
    said = f"@ros2_lv/7/{zenoh_id}/0/1/MP/%/%/slz/%chatter/std_msgs::msg::dds_::String_/{STRING}/::,7:,:,:,,"
    heard = f"@ros2_lv/7/{zenoh_id}/0/2/MS/%/%/slz/%heard/std_msgs::msg::dds_::String_/{STRING}/2::,5:,:,:,,"
    assert tokens == {f"@ros2_lv/7/{zenoh_id}/0/0/NN/%/%/slz", said, heard}
    # rmw_zenoh makes a publisher's ID of its token: the low half of XXH3-128, then the high one.
    number = xxhash.xxh3_128_intdigest(said.encode())
    assert publisher.gid == (number % 2**64).to_bytes(8, "little") + (number >> 64).to_bytes(8, "little")


async def test_messages_arrive_with_number_time_and_publisher() -> None:
    with router() as endpoint:
        session = RosSession(ZenohUrl(endpoint, 7))
        publisher = session.advertise(CHATTER)
        async with running(session):
            await until(session.is_connected)
            assert not publisher.has_listener()
            client = Client(endpoint)
            client.listen("7/**")
            await until(publisher.has_listener)
            begun_ns = time.time_ns()
            publisher.put(text("one"))
            publisher.put(text("two"))
            first, second = await client.next(), await client.next()
            client.close()
    assert str(first.key_expr) == KEY
    assert bytes(second.payload) == b"\0\1\0\0\4\0\0\0two\0"
    one, two = unpack(bytes(first.attachment)), unpack(bytes(second.attachment))
    assert one is not None
    assert two is not None
    assert (one.number, two.number, one.gid, two.gid) == (1, 2, publisher.gid, publisher.gid)
    assert begun_ns <= one.source_ns <= two.source_ns <= time.time_ns()


async def test_one_who_subscribes_later_gets_the_last_message_of_a_latched_topic() -> None:
    with router() as endpoint:
        session = RosSession(ZenohUrl(endpoint))
        publisher = session.advertise(LAST)
        async with running(session):
            await until(session.is_connected)
            assert publisher.has_listener()
            publisher.put(text("one"))
            publisher.put(text("two"))
            client = Client(endpoint)
            client.listen_late(f"0/slz/last/std_msgs::msg::dds_::String_/{STRING}")
            assert bytes((await client.next()).payload) == text("two")
            client.close()


async def test_an_absent_router_blocks_nothing_and_is_found_when_it_comes(
    caplog: pytest.LogCaptureFixture,
) -> None:
    caplog.set_level("INFO")
    port = free_port(socket.SOCK_STREAM)
    session = RosSession(ZenohUrl(f"tcp/127.0.0.1:{port}"))
    publisher = session.advertise(LAST)
    async with running(session):
        await until(lambda: session.is_open)
        await until(lambda: "no Zenoh router" in caplog.text)
        assert not session.is_connected()
        publisher.put(text("early"))
        with router(port) as endpoint:
            await until(lambda: "connected to Zenoh" in caplog.text)
            assert session.is_connected()
            client = Client(endpoint)
            client.listen_late(f"0/slz/last/std_msgs::msg::dds_::String_/{STRING}")
            assert bytes((await client.next()).payload) == text("early")
            client.close()
        await until(lambda: "is gone" in caplog.text)
        publisher.put(text("after it"))
    said = [record.getMessage() for record in caplog.records if record.name.endswith("ros_session")]
    assert [line.split(":")[1].split(" at ")[0] for line in said] == [
        " no Zenoh router answers",
        " connected to Zenoh",
        " the Zenoh router",
    ]
    assert all("\n" not in line for line in said)


async def test_an_endpoint_that_cannot_be_opened_is_tried_again(
    caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("companion.flight.rmw.ros_session.FIRST_PAUSE_S", 0.001)
    session = RosSession(ZenohUrl("nonsense/127.0.0.1:1"))
    async with running(session):
        await until(lambda: caplog.text.count("Zenoh cannot be opened") > 1)
        assert not session.is_open
    assert "Traceback" not in caplog.text
    assert session.statistics() == {"connected": False, "sent": 0, "lost": 0, "replaced": 0}


async def test_a_session_that_is_closed_while_it_opens_does_not_stay_open(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    begun, go_on = threading.Event(), threading.Event()
    closed = threading.Event()
    close = RosSession.close

    def close_and_tell(self: RosSession) -> None:
        close(self)
        if go_on.is_set():
            closed.set()

    monkeypatch.setattr(RosSession, "close", close_and_tell)

    def slow_digest(_: bytes) -> int:
        begun.set()
        go_on.wait(20)
        return 0

    session = RosSession(ZenohUrl("tcp/127.0.0.1:1"))
    session.advertise(CHATTER)
    monkeypatch.setattr("xxhash.xxh3_128_intdigest", slow_digest)
    task = asyncio.create_task(session.run())
    await until(begun.is_set)
    task.cancel()
    await asyncio.gather(task, return_exceptions=True)
    session.close()
    go_on.set()
    await until(closed.is_set)  # by the thread that opened it
    assert not session.is_open


async def test_messages_of_this_type_are_taken_and_of_another_definition_counted() -> None:
    received: list[tuple[bytes, bytes]] = []
    with router() as endpoint:
        session = RosSession(ZenohUrl(endpoint, 7))
        subscription = session.subscribe(HEARD, lambda *message: received.append(message))
        async with running(session):
            await until(session.is_connected)
            client = Client(endpoint)
            client.session.put(f"{HEARD_KEY}/RIHS01_{'0' * 64}", b"x", attachment=b"y")
            client.session.put(f"{HEARD_KEY}/{STRING}", b"one", attachment=b"a")
            client.session.put(f"{HEARD_KEY}/TypeHashNotSupported", b"two")
            await until(lambda: len(received) == 2)
            client.close()
    assert received == [(b"one", b"a"), (b"two", b"")]
    assert subscription.wrong_type == 1


async def test_keys_of_humble_name_no_hash() -> None:
    with router() as endpoint:
        session = RosSession(ZenohUrl(endpoint, 7, has_hashes=False))
        publisher = session.advertise(CHATTER)
        async with running(session):
            await until(session.is_connected)
            client = Client(endpoint)
            client.listen("7/chatter/std_msgs::msg::dds_::String_/TypeHashNotSupported")
            await until(publisher.has_listener)
            publisher.put(text("one"))
            assert bytes((await client.next()).payload) == text("one")
            client.close()


# The option --ros2.


def test_router_and_domain(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("ROS_DOMAIN_ID", raising=False)
    assert parse_zenoh_url("zenoh") == ZenohUrl("tcp/localhost:7447", 0)
    assert parse_zenoh_url("zenoh:tcp/10.0.0.2:7448") == ZenohUrl("tcp/10.0.0.2:7448", 0)
    assert parse_zenoh_url("zenoh:tcp/[::1]:7447?domain=7") == ZenohUrl("tcp/[::1]:7447", 7)
    assert parse_zenoh_url("zenoh?domain=7&distro=humble") == ZenohUrl(domain=7, has_hashes=False)
    monkeypatch.setenv("ROS_DOMAIN_ID", "42")
    assert parse_zenoh_url("zenoh").domain == 42
    assert parse_zenoh_url("zenoh?domain=3").domain == 3


@pytest.mark.parametrize(
    "text",
    [
        *("", "dds", "zenoh:", "zenoh:10.0.0.2:7447", "zenoh:tcp/10.0.0.2", "zenoh:tcp/10.0.0.2:0"),
        *("zenoh:tcp/10.0.0.2:65536", "zenoh?domain=", "zenoh?domain=233", "zenoh?domain=-1"),
        *("zenoh?distro=jazzy", "zenoh?name=1", "zenoh:tcp/a b:7447", "zenoh?domain=²"),
    ],
)
def test_what_is_wrong_is_said_in_one_line(text: str) -> None:
    with pytest.raises(UsageError) as said:
        parse_zenoh_url(text)
    assert "--ros2" in str(said.value)
    assert "\n" not in str(said.value)
