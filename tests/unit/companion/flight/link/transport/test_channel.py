"""Streams, servers and serial lines as channels: their data, and their ends."""

from __future__ import annotations

import asyncio
import errno
import itertools
import os
import socket
import termios
from collections.abc import Callable, Iterator
from types import SimpleNamespace
from typing import Any

import pytest
import serial
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from companion.flight.link.transport import channel as channels
from companion.flight.link.transport import reconnecting
from companion.flight.link.transport.channel import (
    MAX_UNACKNOWLEDGED_BYTES,
    STALLED_S,
    UNACKNOWLEDGED_MS,
    StreamChannel,
)
from companion.flight.link.transport.mavlink_url import Url, parse_url
from companion.flight.link.transport.reconnecting import Transport
from companion.flight.link.transport.serial_port import SerialChannel
from companion.flight.link.transport.tcp import ServerChannel, open_tcp
from companion.flight.link.wire.codec import Codec
from companion.runtime.errors import UsageError
from tests.integration.link_bench import virtually
from tests.ports import free_port


class Wire:
    """What asyncio gives a protocol."""

    def __init__(self, raw: socket.socket) -> None:
        self.raw = raw
        self.sent: list[bytes] = []
        self.backlog, self.closing = 0, False

    def get_extra_info(self, name: str) -> Any:
        return {"socket": self.raw}[name]

    def write(self, data: bytes) -> None:
        self.sent.append(data)

    def get_write_buffer_size(self) -> int:
        return self.backlog

    def is_closing(self) -> bool:
        return self.closing

    def close(self) -> None:
        self.closing = True


# ---- streams ------------------------------------------------------------------------------------


@pytest.fixture
def wire() -> Iterator[Wire]:
    with socket.socket() as raw:
        yield Wire(raw)


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> SimpleNamespace:
    """Return the clock by which a stream is stalled."""
    made = SimpleNamespace(now=100.0)
    monkeypatch.setattr(channels, "monotonic", lambda: made.now)
    return made


async def test_a_stream_takes_nothing_before_it_is_open_and_after_it_is_closed(wire: Wire) -> None:
    channel = StreamChannel(lambda _: None)
    assert not channel.write(b"before")
    channel.connection_made(wire)  # type: ignore[arg-type]
    assert channel.write(b"during")
    wire.backlog = MAX_UNACKNOWLEDGED_BYTES + 1
    assert not channel.write(b"too much")
    wire.backlog = 0
    channel.close()
    assert not channel.write(b"after")
    assert wire.sent == [b"during"]


async def test_a_peer_that_acknowledges_nothing_is_sent_little_and_after_a_second_it_is_reset(
    clock: SimpleNamespace,
) -> None:
    loop = asyncio.get_running_loop()
    with socket.socket() as server:
        server.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 2048)
        server.bind(("127.0.0.1", 0))
        server.listen()
        channel = await open_tcp(parse_url(f"tcp:127.0.0.1:{server.getsockname()[1]}"), lambda _: None)
        client, _ = server.accept()
        with client:
            client.setblocking(False)
            taken = 50 * sum(channel.write(bytes(50)) for _ in range(1000))
            began = clock.now
            while not channel.lost.done() and clock.now < began + 10 * STALLED_S:
                clock.now += STALLED_S / 10
                taken += 50 * channel.write(bytes(50))
            assert taken < 3 * MAX_UNACKNOWLEDGED_BYTES
            assert clock.now - began > STALLED_S
            assert await asyncio.wait_for(channel.lost, 1) == "nothing acknowledged for 1 s"
            await asyncio.sleep(0)  # the loop closes the socket; what is read before would let more be sent
            arrived = len(await loop.sock_recv(client, 65536))
            with pytest.raises(ConnectionResetError):  # what waited is gone, in the kernel too
                await loop.sock_recv(client, 65536)
            assert arrived < taken


async def test_a_slow_stream_is_not_reset_nor_one_that_was_idle(
    wire: Wire, clock: SimpleNamespace, monkeypatch: pytest.MonkeyPatch
) -> None:
    channel = StreamChannel(lambda _: None)
    channel.connection_made(wire)  # type: ignore[arg-type]
    acknowledged = 0
    monkeypatch.setattr(channels, "_unacknowledged", lambda _: sum(map(len, wire.sent)) - acknowledged)
    taken = 0
    for _ in range(100):
        taken += channel.write(bytes(100))
        clock.now += 0.9 * STALLED_S
        acknowledged += 10
    assert acknowledged < taken * 100 <= acknowledged + MAX_UNACKNOWLEDGED_BYTES + 100
    assert not channel.lost.done()
    acknowledged = taken * 100
    clock.now += 100 * STALLED_S
    assert channel.write(bytes(100))


async def test_a_stream_that_was_never_open_can_be_closed() -> None:
    channel = StreamChannel(lambda _: None)
    channel.close()
    assert await asyncio.wait_for(channel.lost, 1) == "closed by the other side"


async def test_a_server_hangs_up_on_all_who_called_when_it_closes() -> None:
    came: list[bytes] = []
    server, loop = ServerChannel(came.append), asyncio.get_running_loop()
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    await server.listen("127.0.0.1", port)
    with socket.create_connection(("127.0.0.1", port)) as client:
        client.setblocking(False)
        await loop.sock_sendall(client, b"here")
        while not came:
            await asyncio.sleep(0)
        server.close()
        assert await loop.sock_recv(client, 10) == b""
    assert await server.lost == "closed"
    server.close()
    with pytest.raises(ConnectionRefusedError):
        socket.create_connection(("127.0.0.1", port))


async def test_a_server_that_never_listened_can_be_closed() -> None:
    server = ServerChannel(lambda _: None)
    assert not server.write(b"x")
    server.close()
    assert await asyncio.wait_for(server.lost, 1) == "closed"


async def accepting(server: ServerChannel) -> Callable[[], Any]:
    """Let a server listen without a socket; return what makes the protocol of a client."""
    made: list[Callable[[], Any]] = []

    async def create_server(factory: Callable[[], Any], *_: Any) -> Any:
        made.append(factory)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(asyncio.get_running_loop(), "create_server", create_server)
        await server.listen("127.0.0.1", 0)
    return made[0]


async def test_streams_of_several_clients_do_not_mix_wherever_they_are_cut() -> None:
    codec, received = Codec(191), []
    server = ServerChannel(lambda data: received.extend(m.get_srcSystem() for m in codec.decode(data)))
    accept = await accepting(server)
    clients = [(accept(), Codec(component)) for component in (1, 190)]
    for system, (_, sender) in enumerate(clients, 1):
        sender.system_id = system
    for cut in range(1, 21):
        beat = mavlink.MAVLink_heartbeat_message(2, 3, 81, 4, 4, 3)
        frames = [sender.encode(beat) for _, sender in clients]
        for part in (slice(0, cut), slice(cut, None)):
            for (client, _), frame in zip(clients, frames, strict=True):
                client.data_received(frame[part])
    accept().data_received(b"no frame")
    assert received == [1, 2] * 20
    assert (codec.lost, codec.bad, codec.bad_bytes) == (0, 0, 8)


def is_listening(raw: socket.socket) -> bool:
    return bool(raw.getsockopt(socket.SOL_SOCKET, socket.SO_ACCEPTCONN))


async def test_the_kernel_gives_up_silent_streams_of_both_kinds(monkeypatch: pytest.MonkeyPatch) -> None:
    changed: dict[int, Any] = {}
    set_option = socket.socket.setsockopt

    def noted(self: socket.socket, *option: Any) -> None:
        set_option(self, *option)
        changed[self.fileno()] = self

    monkeypatch.setattr(socket.socket, "setsockopt", noted)
    server, port = ServerChannel(lambda _: None), free_port(socket.SOCK_STREAM)
    await server.listen("127.0.0.1", port)
    channel: Any = await open_tcp(parse_url(f"tcp:127.0.0.1:{port}"), lambda _: None)
    while not server.write(b"x"):
        await asyncio.sleep(0)
    ends = [raw for raw in changed.values() if raw.fileno() >= 0 and not is_listening(raw)]
    assert {raw.getsockname()[1] == port for raw in ends} == {True, False}
    for raw in ends:
        assert raw.getsockopt(socket.IPPROTO_TCP, socket.TCP_USER_TIMEOUT) == UNACKNOWLEDGED_MS
    server.close()
    assert await asyncio.wait_for(channel.lost, 1)


async def test_where_the_system_tells_nothing_and_cannot_give_up_on_silence_a_stream_is_opened_all_the_same(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.delattr(socket, "TCP_USER_TIMEOUT", raising=False)
    monkeypatch.setattr(channels, "sys", SimpleNamespace(platform="darwin"))
    with socket.create_server(("127.0.0.1", 0)) as server:
        channel = await open_tcp(parse_url(f"tcp:127.0.0.1:{server.getsockname()[1]}"), lambda _: None)
        client, _ = server.accept()
        with client:
            assert channel.write(b"x")
            assert client.recv(1) == b"x"
        channel.close()
        assert await asyncio.wait_for(channel.lost, 1)


# ---- serial lines -------------------------------------------------------------------------------


@pytest.fixture
def line() -> Iterator[tuple[int, str]]:
    """Give the far end of a pseudo-terminal and the name of its near end."""
    far, near = os.openpty()
    name = os.ttyname(near)
    os.close(near)
    yield far, name
    os.close(far)


async def serial_channel(name: str) -> tuple[SerialChannel, list[bytes], serial.Serial]:
    came: list[bytes] = []
    port = serial.Serial(name, timeout=0)
    return SerialChannel(port, came.append), came, port


@pytest.mark.parametrize("call", ["read", "write"])
async def test_a_serial_line_that_fails_ends_with_the_reason(
    line: tuple[int, str], monkeypatch: pytest.MonkeyPatch, call: str
) -> None:
    far, name = line
    channel, _, _ = await serial_channel(name)

    def failed(*_: Any) -> Any:
        raise OSError(errno.EIO, "Input/output error")

    with monkeypatch.context() as patch:
        patch.setattr(os, call, failed)
        if call == "write":
            assert channel.write(b"x")
        else:
            assert os.write(far, b"x") == 1
        assert await asyncio.wait_for(channel.lost, 1) == "Input/output error"
    assert not channel.write(b"after")


async def test_a_line_that_says_it_is_readable_and_is_not_goes_on(
    line: tuple[int, str], monkeypatch: pytest.MonkeyPatch
) -> None:
    far, name = line
    channel, came, port = await serial_channel(name)
    read, waits = os.read, [BlockingIOError()]

    def waiting(descriptor: int, size: int) -> bytes:
        if descriptor == port.fileno() and waits:
            raise waits.pop()
        return read(descriptor, size)

    monkeypatch.setattr(os, "read", waiting)
    os.write(far, b"late\n")
    while not came:
        await asyncio.sleep(0)
    assert came == [b"late\n"]
    assert waits == []
    channel.close()


@pytest.mark.parametrize("gone", [None, OSError("gone"), termios.error(5, "gone")])
async def test_a_stalled_line_drops_what_waits_and_closes_at_once_though_the_device_is_gone(
    line: tuple[int, str], monkeypatch: pytest.MonkeyPatch, gone: Exception | None
) -> None:
    channel, _, port = await serial_channel(line[1])
    cleared: list[str] = []

    def stalled(*_: Any) -> int:
        raise BlockingIOError

    def clear() -> None:
        cleared.append("output")
        if gone is not None:
            raise gone

    monkeypatch.setattr(port, "reset_output_buffer", clear)
    with monkeypatch.context() as patch:
        patch.setattr(os, "write", stalled)
        assert channel.write(b"waits")
    channel.close()
    reason = await asyncio.wait_for(channel.lost, 1)
    assert cleared == ["output"]
    assert reason == ("closed" if gone is None else f"closed ({gone})")


# ---- what keeps them open -----------------------------------------------------------------------


def test_a_serial_port_that_another_program_holds_is_one_line(line: tuple[int, str]) -> None:
    async def script() -> None:
        with serial.Serial(line[1], exclusive=True):
            said = f"^{line[1]},57600: another program has the port open; stop it$"
            with pytest.raises(UsageError, match=said):
                await asyncio.wait_for(Transport(parse_url(f"{line[1]},57600")).run(print), 5)

    virtually(script)


def test_a_device_that_comes_later_and_is_held_for_a_moment_is_waited_for(
    line: tuple[int, str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """At boot others look at a new serial port first."""

    async def script() -> None:
        exists, absent = os.path.exists, [True]
        monkeypatch.setattr(os.path, "exists", lambda path: not absent.pop() if absent else exists(path))
        way = Transport(parse_url(f"{line[1]},57600"))
        with serial.Serial(line[1], exclusive=True):
            task = asyncio.create_task(way.run(lambda _: None))
            await asyncio.sleep(3)
            assert not task.done()
        async with asyncio.timeout(60):
            while not way.up:
                await asyncio.sleep(0.01)
        task.cancel()
        await asyncio.gather(task, return_exceptions=True)

    virtually(script)


@pytest.mark.parametrize(
    "url", ["tcp:192.168.1..10:5760", "udpin:a..b:14550", "udpout:a..b:14550", "tcpin:a..b:1"]
)
def test_a_name_that_no_host_can_have_is_one_line(url: str) -> None:
    async def script() -> None:
        with pytest.raises(UsageError, match="no host has such a name"):
            await asyncio.wait_for(Transport(parse_url(url)).run(print), 5)

    virtually(script)


def test_a_speed_that_the_port_refuses_is_told_and_tried_again(
    line: tuple[int, str], monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    def refused(*_: Any, **__: Any) -> Any:
        raise ValueError("Invalid baud rate: 57600")

    async def script() -> None:
        monkeypatch.setattr("serial.Serial", refused)
        with pytest.raises(TimeoutError):
            await asyncio.wait_for(Transport(parse_url(f"{line[1]},57600")).run(print), 5)
        assert "Invalid baud rate" in caplog.text

    virtually(script)


@pytest.mark.parametrize("call", ["tcsetattr", "tcflush"])
def test_a_device_that_vanishes_while_it_is_opened_is_waited_for(
    line: tuple[int, str], monkeypatch: pytest.MonkeyPatch, call: str
) -> None:
    """A USB autopilot that reboots, say."""
    real, failures = getattr(termios, call), [termios.error(errno.EIO, "Input/output error")]

    def vanished(*arguments: Any) -> Any:
        if failures:
            raise failures.pop()
        return real(*arguments)

    async def script() -> None:
        monkeypatch.setattr(termios, call, vanished)
        way = Transport(parse_url(f"{line[1]},57600"))
        task = asyncio.create_task(way.run(lambda _: None))
        async with asyncio.timeout(5):
            while not (way.up or task.done()):
                await asyncio.sleep(0.01)
        assert way.up
        assert failures == []
        task.cancel()
        await asyncio.gather(task, return_exceptions=True)

    virtually(script)


def test_a_serial_port_is_free_again_when_the_link_has_ended(line: tuple[int, str]) -> None:
    async def script() -> None:
        way = Transport(parse_url(f"{line[1]},57600"))
        task = asyncio.create_task(way.run(lambda _: None))
        while not way.up:
            await asyncio.sleep(0.01)
        task.cancel()
        await asyncio.gather(task, return_exceptions=True)
        serial.Serial(line[1], exclusive=True).close()

    virtually(script)


@pytest.mark.parametrize(
    ("url", "advice"),
    [("/dev/null,57600", "; add the user to the group 'dialout'"), ("tcp:127.0.0.1:5760", "")],
)
def test_an_address_that_may_not_be_opened_is_one_line(
    monkeypatch: pytest.MonkeyPatch, url: str, advice: str
) -> None:
    def denied(*_: Any, **__: Any) -> Any:
        raise serial.SerialException(errno.EACCES, "could not open port")

    async def script() -> None:
        monkeypatch.setattr("serial.Serial", denied)
        monkeypatch.setattr(asyncio.get_running_loop(), "create_connection", denied)
        parsed = parse_url(url)
        with pytest.raises(UsageError) as caught:
            await asyncio.wait_for(Transport(parsed).run(print), 5)
        assert str(caught.value) == f"{parsed}: permission denied{advice}"

    virtually(script)


class Fleeting:
    """A channel that is lost as soon as it is open, and may never say so when it is closed."""

    def __init__(self, *, ends: bool) -> None:
        self.lost: asyncio.Future[str] = asyncio.get_running_loop().create_future()
        if ends:
            self.lost.set_result("gone")

    def write(self, data: bytes) -> bool:
        return True

    def close(self) -> None:
        """Close nothing."""


def kept(monkeypatch: pytest.MonkeyPatch, *, ends: bool, hears: bool) -> tuple[Transport, list[float]]:
    """Return a transport whose channels are fleeting, and when they were opened."""
    opened: list[float] = []

    async def opener(_: Url, on_bytes: Any) -> Fleeting:
        opened.append(asyncio.get_running_loop().time())
        if hears:
            on_bytes(b"x")
        return Fleeting(ends=ends)

    monkeypatch.setitem(reconnecting._OPENERS, "tcp", opener)
    return Transport(parse_url("tcp:127.0.0.1:5760")), opened


def test_a_channel_on_which_nobody_speaks_is_opened_again_ever_later(monkeypatch: pytest.MonkeyPatch) -> None:
    async def script() -> None:
        way, opened = kept(monkeypatch, ends=True, hears=False)
        with pytest.raises(TimeoutError):
            await asyncio.wait_for(way.run(lambda _: None), 13)
        gaps = [after - before for before, after in itertools.pairwise(opened)]
        assert gaps == pytest.approx([0.5, 1, 2, 4, 5], abs=0.05)

    virtually(script)


def test_a_channel_that_does_not_close_holds_nothing_up(monkeypatch: pytest.MonkeyPatch) -> None:
    async def script() -> None:
        way, opened = kept(monkeypatch, ends=False, hears=False)
        task, loop = asyncio.create_task(way.run(lambda _: None)), asyncio.get_running_loop()
        while not way.up:
            await asyncio.sleep(0.01)
        began = loop.time()
        task.cancel()
        await asyncio.gather(task, return_exceptions=True)
        assert loop.time() - began == pytest.approx(reconnecting.FLUSH_S, abs=0.05)
        assert len(opened) == 1

    virtually(script)
