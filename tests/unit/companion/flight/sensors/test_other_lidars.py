"""Sensors on a serial line, over MAVLink, and the Mid-360's handshake, each on the real wire."""

from __future__ import annotations

import asyncio
import contextlib
import logging
import os
import socket
import tty
from collections import defaultdict
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pytest

from companion.flight.link.link import Link
from companion.flight.sensors.decoders.livox_session import LivoxSession
from companion.flight.sensors.lidar_url import open_lidar
from companion.flight.sensors.mavlink_lidar import MavlinkLidar
from companion.flight.sensors.returns import Returns
from companion.runtime.errors import UsageError
from companion.runtime.event import Event, Unsubscribe
from companion.runtime.lockstep_loop import LockstepLoop
from params import Parameters
from sitl.sensors.sf45 import Sf45, frame
from tests.unit.companion.flight.sensors.decoders.livox_control_unit import ControlUnit
from tests.unit.companion.flight.sensors.test_mavlink_ranges import beam

MS = 1_000_000


@pytest.fixture
def loop() -> Iterator[LockstepLoop]:
    clock = [0]

    def advance() -> int:
        clock[0] += MS
        return clock[0]

    loop = LockstepLoop(advance)
    yield loop
    loop.close()


def test_a_scanner_on_a_serial_line_is_asked_and_its_readings_come_out(loop: LockstepLoop) -> None:
    ours, theirs = os.openpty()
    tty.setraw(ours)
    os.set_blocking(ours, False)
    batches: list[Returns] = []
    sensor = Sf45(np.random.default_rng(1))

    async def scenario() -> None:
        lidar = open_lidar(f"lightware:{os.ttyname(theirs)},921600", Parameters(), batches.append)
        running = asyncio.ensure_future(lidar.run())
        for _ in range(20_000):  # the kernel's line takes its own time
            await asyncio.sleep(0.01)
            with contextlib.suppress(BlockingIOError):
                os.write(ours, sensor.receive(os.read(ours, 4096)))
            if sensor.streaming:
                break
        for k in range(50):
            os.write(ours, frame(44, (500 + k).to_bytes(2, "little") + bytes(2)))
            await asyncio.sleep(0.01)
        for _ in range(20_000):
            await asyncio.sleep(0.01)
            if lidar.statistics()["returns"] == 50:
                break
        running.cancel()
        await asyncio.gather(running, return_exceptions=True)
        assert lidar.statistics()["returns"] == 50
        assert lidar.last_arrival_ns is not None

    loop.run_until_complete(scenario())
    os.close(ours)
    os.close(theirs)
    points = np.concatenate([batch.xyz_sensor_m for batch in batches])
    stamps = np.concatenate([batch.stamp_ns for batch in batches])
    np.testing.assert_allclose(points[:, 0], (500 + np.arange(50)) / 100)
    assert (np.diff(stamps) >= 0).all()


def test_a_mid_360_is_told_where_to_send(loop: LockstepLoop) -> None:
    unit = ControlUnit()
    with (
        socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as control,
        socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe,
    ):
        control.bind(("127.0.0.1", 0))
        control.setblocking(False)
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
        probe.close()

        async def scenario() -> None:
            url = f"livox:127.0.0.1:{port}?sensor=127.0.0.1:{control.getsockname()[1]}"
            lidar = open_lidar(url, Parameters(), lambda _: None)
            running = asyncio.ensure_future(lidar.run())
            for _ in range(200):
                await asyncio.sleep(0.01)
                try:
                    data, sender = control.recvfrom(2048)
                except BlockingIOError:
                    continue
                control.sendto(unit.receive(data) or b"", sender)
                break
            running.cancel()
            await asyncio.gather(running, return_exceptions=True)

        loop.run_until_complete(scenario())
    assert unit.sampling
    assert unit.point_host == ("127.0.0.1", port)


def test_a_mid_360_that_answers_is_left_in_peace_until_it_has_been_silent_for_long(
    loop: LockstepLoop, caplog: pytest.LogCaptureFixture
) -> None:
    caplog.set_level(logging.INFO)
    unit, asked = ControlUnit(), list[float]()
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as control:
        control.bind(("127.0.0.1", 0))
        control.setblocking(False)

        async def scenario() -> None:
            session = LivoxSession(f"127.0.0.1:{control.getsockname()[1]}", 56301, lambda: None)
            running = asyncio.ensure_future(session.run())
            end_s = loop.time() + 5.0
            while loop.time() < end_s:
                await asyncio.sleep(0.01)
                with contextlib.suppress(BlockingIOError):
                    data, sender = control.recvfrom(2048)
                    asked.append(loop.time())
                    for answer in (b"noise", unit.receive(data) or b"", b"noise"):
                        control.sendto(answer, sender)
            running.cancel()
            await asyncio.gather(running, return_exceptions=True)

        loop.run_until_complete(scenario())
    assert np.diff(asked).tolist() == pytest.approx([3.0], abs=0.25)
    assert caplog.text.count("LiDAR at 127.0.0.1 answers") == 1


def test_ranges_of_the_autopilot_stand_in_for_a_lidar(monkeypatch: pytest.MonkeyPatch) -> None:
    batches: list[Returns] = []
    link = Link("udpin:127.0.0.1:14999", Parameters())
    messages: defaultdict[tuple[str, bool], Event[[Any, int]]] = defaultdict(Event)

    def subscribe(name: str, handler: Callable[[Any, int], None], *, anyone: bool = False) -> Unsubscribe:
        return messages[name, anyone].subscribe(handler)

    monkeypatch.setattr(link, "subscribe", subscribe)
    lidar = open_lidar("mavlink:", Parameters(), batches.append, link)
    assert isinstance(lidar, MavlinkLidar)

    async def scenario() -> None:
        running = asyncio.ensure_future(lidar.run())
        await asyncio.sleep(0)
        link.inbox.clock.stamp_ns(1000, 5 * 10**9)  # of a pose
        messages["*", True].emit(beam(800, 25), 5 * 10**9)
        assert not batches  # what anyone sends is no range of the autopilot's
        messages["*", False].emit(beam(800, 25), 5 * 10**9)
        running.cancel()
        await asyncio.gather(running, return_exceptions=True)

    asyncio.run(scenario())
    assert [len(batch) for batch in batches] == [1]


@pytest.mark.parametrize(
    ("url", "says"),
    [
        ("lightware:udpin:0.0.0.0:1", "serial line"),
        ("lightware:", "lightware:"),
        ("livox:0.0.0.0:56301?sensor=", "not understood"),
        ("livox:0.0.0.0:56301?sensor=lidar", "not understood"),
        ("livox:0.0.0.0:56301?sensor=1.2.3.4:0", "not understood"),
        ("livox:0.0.0.0:56301?other=1.2.3.4", "not understood"),
        ("mavlink:", "no sensor"),
    ],
)
def test_a_wrong_url_is_one_clear_line(url: str, says: str) -> None:
    with pytest.raises(UsageError, match=says) as error:
        open_lidar(url, Parameters(), print)
    assert "\n" not in str(error.value)
