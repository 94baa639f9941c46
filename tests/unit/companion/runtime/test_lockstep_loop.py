"""Event loop on simulated time."""

import asyncio
import socket
import threading
import time
from collections.abc import Callable, Iterator
from typing import Any

import pytest

from companion.runtime.errors import CompanionError
from companion.runtime.lockstep_loop import LockstepClient, LockstepLoop

TICK_NS = 5_000_000


class Ticker:
    def __init__(self) -> None:
        self.now_ns = 0
        self.each: Callable[[], None] = lambda: None

    def advance(self) -> int:
        self.now_ns += TICK_NS
        self.each()
        return self.now_ns


@pytest.fixture
def ticker() -> Ticker:
    return Ticker()


@pytest.fixture
def loop(ticker: Ticker) -> Iterator[LockstepLoop]:
    loop = LockstepLoop(ticker.advance)
    yield loop
    loop.close()


def test_sleep_passes_simulated_time_only(loop: LockstepLoop) -> None:
    start, wall = loop.time(), time.perf_counter()
    loop.run_until_complete(asyncio.sleep(100))
    assert loop.time() - start == pytest.approx(100, abs=0.006)
    assert time.perf_counter() - wall < 20


def test_time_outs_follow_simulated_time(loop: LockstepLoop) -> None:
    async def wait() -> None:
        async with asyncio.timeout(3):
            await asyncio.Event().wait()

    start = loop.time()
    with pytest.raises(TimeoutError):
        loop.run_until_complete(wait())
    assert loop.time() - start == pytest.approx(3, abs=0.006)


def test_time_stands_still_while_a_thread_computes(loop: LockstepLoop) -> None:
    release = threading.Event()

    async def compute() -> float:
        before = asyncio.get_running_loop().time()
        work = asyncio.get_running_loop().run_in_executor(None, release.wait, 10)
        threading.Timer(0.05, release.set).start()
        await work
        return asyncio.get_running_loop().time() - before

    assert loop.run_until_complete(compute()) == 0


def test_a_computation_takes_the_simulated_time_that_is_said(ticker: Ticker) -> None:
    async def compute() -> tuple[float, int]:
        running = asyncio.get_running_loop()
        before_s = running.time()
        answer = await running.run_in_executor(None, lambda: 42)
        with pytest.raises(ZeroDivisionError):
            await running.run_in_executor(None, lambda: 1 // 0)
        return running.time() - before_s, answer

    loop = LockstepLoop(ticker.advance, lambda wall_s: 0.25 if wall_s > 0 else 0.0)
    took_s, answer = loop.run_until_complete(compute())
    loop.close()
    assert took_s == pytest.approx(0.5, abs=0.011)
    assert answer == 42


def test_what_the_simulator_sends_arrives_in_the_same_tick(loop: LockstepLoop, ticker: Ticker) -> None:
    """A datagram sent during a tick is handled before the next tick."""
    seen: list[tuple[int, int]] = []

    class Sink(asyncio.DatagramProtocol):
        def datagram_received(self, data: bytes, addr: Any) -> None:
            seen.append((int(data), ticker.now_ns))

    async def listen() -> None:
        transport, _ = await asyncio.get_running_loop().create_datagram_endpoint(
            Sink, local_addr=("127.0.0.1", 0)
        )
        out = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        ticker.each = lambda: out.sendto(str(ticker.now_ns).encode(), transport.get_extra_info("sockname"))
        await asyncio.sleep(1)
        ticker.each = lambda: None
        transport.close()
        out.close()

    loop.run_until_complete(listen())
    assert len(seen) >= 199
    assert all(sent == received for sent, received in seen)


def test_a_loop_let_go_runs_on_by_itself_though_the_simulator_dies_and_a_thread_computes(
    loop: LockstepLoop, ticker: Ticker
) -> None:
    release = threading.Event()

    def die() -> None:
        loop.let_go()
        raise CompanionError("the simulator ended")

    async def end() -> float:
        before = asyncio.get_running_loop().time()
        ticker.each = die
        await asyncio.sleep(1)
        work = asyncio.get_running_loop().run_in_executor(None, release.wait, 10)
        await asyncio.sleep(1)
        release.set()
        await work
        return asyncio.get_running_loop().time() - before

    assert loop.run_until_complete(end()) >= 2


def test_a_simulator_that_dies_ends_the_flight_beside_it(loop: LockstepLoop, ticker: Ticker) -> None:
    def die() -> None:
        raise CompanionError("the simulator ended")

    ticker.each = die
    with pytest.raises(CompanionError, match="the simulator ended"):
        loop.run_until_complete(asyncio.sleep(1))


def test_client_asks_and_hears_the_time_until_the_simulator_ends() -> None:
    server = socket.create_server(("127.0.0.1", 0))
    client = LockstepClient(server.getsockname()[1])
    peer, _ = server.accept()
    peer.sendall((7).to_bytes(8, "little"))
    assert client.advance() == 7
    assert peer.recv(1) == b"\x01"
    peer.close()
    with pytest.raises(CompanionError, match="ended|answering"):
        client.advance()
    client.close()
    server.close()


def test_no_simulator_is_one_clear_error() -> None:
    with socket.create_server(("127.0.0.1", 0)) as server:
        port = server.getsockname()[1]
    with pytest.raises(CompanionError, match=f"no simulator answers on 127.0.0.1:{port}"):
        LockstepClient(port)
