"""Event loop in memory: datagrams by reference, computations at once, simulated time."""

from __future__ import annotations

import asyncio
import threading
from collections.abc import Coroutine
from typing import Any

import pytest

from tests.search.memory_loop import SIMULATOR, MemoryLoop

TICK_NS = 20_000_000


class Simulator:
    """Clock of 20 ms whose ticks can deliver datagrams."""

    def __init__(self) -> None:
        self.now_ns = 0
        self.due: dict[int, tuple[int, bytes]] = {}
        self.loop = MemoryLoop(self.advance)

    def advance(self) -> int:
        self.now_ns += TICK_NS
        if self.now_ns in self.due:
            self.loop.deliver(*self.due.pop(self.now_ns))
        return self.now_ns

    def run(self, main: Coroutine[Any, Any, None]) -> None:
        try:
            self.loop.run_until_complete(main)
        finally:
            self.loop.close()


class Receiver(asyncio.DatagramProtocol):
    def __init__(self) -> None:
        self.got: list[tuple[bytes, Any, float]] = []
        self.lost = False

    def datagram_received(self, data: bytes, addr: Any) -> None:
        self.got.append((data, addr, asyncio.get_running_loop().time()))

    def connection_lost(self, exc: Exception | None) -> None:
        self.lost = True


def test_a_datagram_arrives_in_its_tick_and_none_after_the_end() -> None:
    simulator, receiver = Simulator(), Receiver()
    simulator.due = {
        3 * TICK_NS: (14_550, b"one"),
        5 * TICK_NS: (14_551, b"else"),
        9 * TICK_NS: (14_550, b"late"),
    }

    async def main() -> None:
        began_s = simulator.loop.time()
        transport, _ = await simulator.loop.create_datagram_endpoint(lambda: receiver, ("127.0.0.1", 14_550))
        await asyncio.sleep(0.15)
        transport.close()
        await asyncio.sleep(0.1)
        assert [(data, addr) for data, addr, _ in receiver.got] == [(b"one", SIMULATOR)]
        assert receiver.got[0][2] - began_s == pytest.approx(0.06, abs=1e-6)
        assert receiver.lost
        assert transport.is_closing()

    simulator.run(main())


def test_what_is_sent_goes_to_the_port_s_function() -> None:
    simulator, sent = Simulator(), list[bytes]()
    simulator.loop.outgoing[14_550] = sent.append

    async def main() -> None:
        for port in (14_550, 14_551):
            transport, _ = await simulator.loop.create_datagram_endpoint(Receiver, ("127.0.0.1", port))
            transport.sendto(bytearray(b"frame"), None)

    simulator.run(main())
    assert sent == [b"frame"]


def test_a_computation_is_done_at_once_in_this_thread_or_late() -> None:
    simulator = Simulator()

    async def main() -> None:
        loop = simulator.loop
        began_s = loop.time()
        assert await loop.run_in_executor(None, threading.get_ident) == threading.get_ident()
        assert loop.time() == began_s
        loop.late_s = 0.5
        assert await loop.run_in_executor(None, int, "7") == 7
        assert loop.time() - began_s == pytest.approx(0.5, abs=0.021)
        with pytest.raises(ValueError, match="invalid literal"):
            await loop.run_in_executor(None, int, "x")

    simulator.run(main())
