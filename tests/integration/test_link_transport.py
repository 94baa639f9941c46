"""Transports over real sockets and a pseudo-terminal: they open, carry, break and open again."""

from __future__ import annotations

import asyncio
import os
import socket
import tty
from collections.abc import AsyncIterator, Iterator
from contextlib import asynccontextmanager, contextmanager
from pathlib import Path

import pytest

from companion.flight.link.transport.channel import MAX_BACKLOG_BYTES
from companion.flight.link.transport.mavlink_url import Url, parse_url
from companion.flight.link.transport.reconnecting import Transport
from companion.runtime.errors import UsageError
from tests.integration.link_bench import Autopilot, running, until, virtually
from tests.ports import free_port


class Ends:
    """A running transport, and what it said."""

    def __init__(self, url: Url) -> None:
        self.transport = Transport(url)
        self.data = b""
        self.ups: list[float] = []
        self.downs: list[str] = []
        loop = asyncio.get_running_loop()
        self.task = asyncio.create_task(
            self.transport.run(self._take, lambda: self.ups.append(loop.time()), self.downs.append)
        )

    def _take(self, data: bytes) -> None:
        self.data += data


@asynccontextmanager
async def transport(url: str) -> AsyncIterator[Ends]:
    ends = Ends(parse_url(url))
    try:
        yield ends
    finally:
        ends.task.cancel()
        await asyncio.gather(ends.task, return_exceptions=True)


@contextmanager
def bound(kind: socket.SocketKind, port: int = 0) -> Iterator[socket.socket]:
    with socket.socket(socket.AF_INET, kind) as made:
        made.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        made.bind(("127.0.0.1", port))
        made.setblocking(False)
        yield made


async def receive(made: socket.socket) -> bytes:
    return await asyncio.get_running_loop().sock_recv(made, 4096)


# ---- UDP ----------------------------------------------------------------------------------------


def test_udpin_answers_whoever_spoke_and_nobody_before() -> None:
    async def script() -> None:
        port = free_port()
        async with transport(f"udpin:127.0.0.1:{port}") as ends:
            await until(lambda: ends.ups)
            ends.transport.write(b"nobody hears this")
            assert ends.transport.dropped == 1
            with bound(socket.SOCK_DGRAM) as vehicle:
                vehicle.sendto(b"here", ("127.0.0.1", port))
                await until(lambda: ends.data == b"here")
                ends.transport.write(b"answer")
                assert await receive(vehicle) == b"answer"

    virtually(script)


def test_udpin_follows_a_vehicle_that_comes_back_from_another_port() -> None:
    async def script() -> None:
        port = free_port()
        async with transport(f"udpin:127.0.0.1:{port}") as ends:
            await until(lambda: ends.ups)
            with bound(socket.SOCK_DGRAM) as old:
                old.sendto(b"1", ("127.0.0.1", port))
                await until(lambda: ends.data == b"1")
            with bound(socket.SOCK_DGRAM) as new:
                new.sendto(b"2", ("127.0.0.1", port))
                await until(lambda: ends.data == b"12")
                for text in (b"a", b"b", b"c"):
                    ends.transport.write(text)
                    assert await receive(new) == text
            assert ends.downs == []

    virtually(script)


def test_udpout_speaks_first_and_survives_that_nobody_listens_yet() -> None:
    async def script() -> None:
        port = free_port()
        async with transport(f"udpout:127.0.0.1:{port}") as ends:
            await until(lambda: ends.ups)
            for _ in range(3):
                ends.transport.write(b"lost")
                await asyncio.sleep(0.1)
            with bound(socket.SOCK_DGRAM, port) as vehicle:
                ends.transport.write(b"found")
                assert await receive(vehicle) == b"found"
            assert ends.downs == []

    virtually(script)


# ---- TCP ----------------------------------------------------------------------------------------


def test_tcp_waits_for_the_server_ever_longer_and_reopens_when_it_goes() -> None:
    async def script() -> None:
        port = free_port(socket.SOCK_STREAM)
        loop = asyncio.get_running_loop()
        begun = loop.time()
        async with transport(f"tcp:127.0.0.1:{port}") as ends:
            await asyncio.sleep(4)
            assert not ends.transport.up
            ends.transport.write(b"lost")
            for expected in (b"first", b"second"):
                with bound(socket.SOCK_STREAM, port) as server:
                    server.listen()
                    client, _ = await loop.sock_accept(server)
                    with client:
                        client.setblocking(False)
                        await until(lambda: ends.transport.up)
                        client.sendall(expected)
                        await until(lambda expected=expected: ends.data.endswith(expected))
                        ends.transport.write(b"answer")
                        assert await receive(client) == b"answer"
                await until(lambda: not ends.transport.up)
            # tried at 0, 0.5, 1.5, 3.5 and 7.5 s
            assert ends.ups[0] - begun == pytest.approx(7.5, abs=0.1)
            assert ends.ups[1] - ends.ups[0] < 1.0
            assert len(ends.downs) == 2
            assert ends.transport.dropped == 1

    virtually(script)


def test_tcpin_serves_whoever_connects() -> None:
    async def script() -> None:
        port = free_port(socket.SOCK_STREAM)
        loop = asyncio.get_running_loop()
        async with transport(f"tcpin:127.0.0.1:{port}") as ends:
            await until(lambda: ends.ups)
            for text in (b"one", b"two"):
                with socket.socket() as client:
                    client.setblocking(False)
                    await loop.sock_connect(client, ("127.0.0.1", port))
                    client.sendall(text)
                    await until(lambda text=text: ends.data.endswith(text))
                    ends.transport.write(b"answer")
                    assert await receive(client) == b"answer"
                await asyncio.sleep(0.1)
            ends.transport.write(b"nobody")
            assert ends.transport.dropped == 1

    virtually(script)


def test_a_peer_that_reads_nothing_costs_no_memory() -> None:
    async def script() -> None:
        loop = asyncio.get_running_loop()
        with bound(socket.SOCK_STREAM) as server:
            server.listen()
            async with transport(f"tcp:127.0.0.1:{server.getsockname()[1]}") as ends:
                client, _ = await loop.sock_accept(server)
                with client:
                    await until(lambda: ends.transport.up)
                    while ends.transport.dropped < 100:
                        ends.transport.write(bytes(8192))
                    assert ends.transport.up

    virtually(script)


# ---- serial -------------------------------------------------------------------------------------


KERNEL_S = 0.0005  # at each step, to carry the bytes of a terminal


@contextmanager
def terminal() -> Iterator[tuple[int, str]]:
    """Give the descriptor of a pseudo-terminal's far end and the name of its near end."""
    far, near = os.openpty()
    tty.setraw(near)
    name = os.ttyname(near)
    os.close(near)
    os.set_blocking(far, False)
    try:
        yield far, name
    finally:
        os.close(far)


@contextmanager
def plugged(plug: Path) -> Iterator[int]:
    """Give the far end of a terminal that has a name of our choice for a while."""
    with terminal() as (far, name):
        plug.symlink_to(name)
        try:
            yield far
        finally:
            plug.unlink()


def test_a_serial_port_carries_both_ways() -> None:
    async def script() -> None:
        with terminal() as (far, name):
            async with transport(f"{name},921600") as ends:
                await until(lambda: ends.ups)
                everything = bytes(range(256))
                os.write(far, everything)
                await until(lambda: ends.data == everything)
                ends.transport.write(everything)
                await asyncio.sleep(0.01)
                assert os.read(far, 4096) == everything

    virtually(script, kernel_s=KERNEL_S)


def test_an_unplugged_device_is_opened_again_when_it_is_back() -> None:
    plug = Path(f"/dev/shm/slz-plug-{os.getpid()}")  # a link stands for the plug; URLs want it under /dev

    async def script() -> None:
        async with transport(f"{plug},57600") as ends:
            with plugged(plug) as far:
                await until(lambda: ends.ups)
                os.write(far, b"one")
                await until(lambda: ends.data == b"one")
            await until(lambda: ends.downs)
            await asyncio.sleep(3)
            assert len(ends.ups) == 1
            with plugged(plug) as far:
                await until(lambda: len(ends.ups) == 2, 6)
                os.write(far, b"two")
                await until(lambda: ends.data == b"onetwo")

    virtually(script, kernel_s=KERNEL_S)


def test_a_stalled_line_neither_blocks_the_program_nor_delays_closing() -> None:
    async def script() -> None:
        loop = asyncio.get_running_loop()
        with terminal() as (_, name):
            async with transport(f"{name},57600") as ends:
                await until(lambda: ends.ups)
                while ends.transport.dropped == 0:  # one byte at a time fills the kernel's buffer exactly
                    ends.transport.write(b"x")
                begun = loop.time()
            assert loop.time() - begun < 0.1

    virtually(script, kernel_s=KERNEL_S)


def test_after_a_stall_the_line_delivers_what_it_took_in_order() -> None:
    async def script() -> None:
        with terminal() as (far, name):
            async with transport(f"{name},57600") as ends:
                await until(lambda: ends.ups)
                written = 0
                while True:
                    ends.transport.write(written.to_bytes(4, "big"))
                    if ends.transport.dropped:
                        break
                    written += 1
                data = b""
                while len(data) < 4 * written:
                    data += os.read(far, 65536)
                    await asyncio.sleep(0.001)
                assert data == b"".join(n.to_bytes(4, "big") for n in range(written))
                assert written * 4 > MAX_BACKLOG_BYTES

    virtually(script, kernel_s=KERNEL_S)


def test_the_link_flies_over_a_serial_line() -> None:
    async def script() -> None:
        with terminal() as (far, name):

            class Line:
                def write(self, data: bytes) -> None:
                    os.write(far, data)

            async with running(f"serial:{name}:921600") as link:
                await asyncio.sleep(0.1)
                autopilot = Autopilot(Line(), system=3)
                loop = asyncio.get_running_loop()
                loop.add_reader(far, lambda: autopilot.hear(os.read(far, 4096)))
                flight = asyncio.create_task(autopilot.fly())
                await until(lambda: link.vehicle.attitude_wxyz and link.inbox.clock.timesync.synced)
                flight.cancel()
                assert link.vehicle.sysid == 3
                assert link.statistics().bad == 0
            loop.remove_reader(far)

    virtually(script, kernel_s=KERNEL_S)


# ---- what no retry can help ---------------------------------------------------------------------


@pytest.mark.parametrize(("scheme", "kind"), [("udpin", socket.SOCK_DGRAM), ("tcpin", socket.SOCK_STREAM)])
def test_a_port_in_use_is_one_line_at_once(scheme: str, kind: socket.SocketKind) -> None:
    async def script() -> None:
        with bound(kind) as other:
            if kind == socket.SOCK_STREAM:
                other.listen()
            port = other.getsockname()[1]
            with pytest.raises(UsageError, match=rf"^{scheme}:127.0.0.1:{port}: port {port} is in use"):
                await asyncio.wait_for(Transport(parse_url(f"{scheme}:127.0.0.1:{port}")).run(print), 5)

    virtually(script)


def test_the_link_says_the_same_and_not_in_a_group() -> None:
    async def script() -> None:
        with bound(socket.SOCK_DGRAM) as other, pytest.raises(UsageError, match="is in use"):
            async with running(f"udpin:127.0.0.1:{other.getsockname()[1]}"):
                await asyncio.sleep(5)

    virtually(script)


def test_an_address_that_is_not_ours_cannot_be_bound() -> None:
    async def script() -> None:
        with pytest.raises(UsageError, match="this machine cannot listen there"):
            await asyncio.wait_for(Transport(parse_url("udpin:192.0.2.1:14550")).run(print), 5)

    virtually(script)


def test_what_is_no_serial_device_is_refused() -> None:
    async def script() -> None:
        with pytest.raises(UsageError, match=r"^/dev/null,57600: not a serial device"):
            await asyncio.wait_for(Transport(parse_url("/dev/null,57600")).run(print), 5)

    virtually(script)
