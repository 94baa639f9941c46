"""Event loop without sockets and threads: datagrams pass by reference, time is that of a simulator."""

from __future__ import annotations

import asyncio
import selectors
import socket
from collections.abc import Callable
from concurrent.futures import Executor
from typing import Any

from companion.runtime.lockstep_loop import CLOCK_OFFSET_NS

LOCAL = "127.0.0.1"
SIMULATOR = (LOCAL, 1)
"""Address from which all datagrams come."""


class MemoryTransport(asyncio.DatagramTransport):
    """Datagram transport whose datagrams are passed to a function instead of a socket."""

    def __init__(self, protocol: Any, sent: Callable[[bytes], None], closed: Callable[[], None]) -> None:
        super().__init__()
        self._protocol, self._sent, self._closed = protocol, sent, closed
        self._closing = False

    def sendto(self, data: Any, addr: Any = None) -> None:
        self._sent(bytes(data))

    def get_write_buffer_size(self) -> int:
        return 0

    def is_closing(self) -> bool:
        return self._closing

    def close(self) -> None:
        if not self._closing:
            self._closing = True
            self._closed()
            asyncio.get_running_loop().call_soon(self._protocol.connection_lost, None)

    def abort(self) -> None:
        self.close()


class MemoryLoop(asyncio.SelectorEventLoop):
    """Event loop in which a program that talks by UDP meets a simulator in memory.

    The program is unchanged: `create_datagram_endpoint` returns transports of this process. Work for an
    executor is done at once in the same thread, so that a flight needs no thread, no system call per tick and
    gives the same result each time.

    Parameters
    ----------
    advance
        Steps the simulator once and returns its time in nanoseconds.

    Attributes
    ----------
    outgoing
        By port: called with each datagram that the program sends from there.
    late_s
        Simulated time that passes before the result of a computation is there.
    """

    def __init__(self, advance: Callable[[], int]) -> None:
        self._advance = advance
        self._simulated_ns = CLOCK_OFFSET_NS
        self._protocols: dict[int, Any] = {}
        self._arrived: list[tuple[int, bytes]] = []
        self.outgoing: dict[int, Callable[[bytes], None]] = {}
        self.late_s = 0.0
        super().__init__(_MemorySelector(self._step_until))

    def time(self) -> float:
        return self._simulated_ns * 1e-9

    def deliver(self, port: int, data: bytes) -> None:
        """Hand a datagram to whoever listens on a port, after this tick; it is lost if nobody does."""
        self._arrived.append((port, data))

    async def create_datagram_endpoint(  # type: ignore[override]
        self, protocol_factory: Callable[[], Any], local_addr: Any = None, *, sock: Any = None, **_: Any
    ) -> tuple[MemoryTransport, Any]:
        port = _port_of(sock) if sock is not None else int(local_addr[1])
        protocol = protocol_factory()
        transport = MemoryTransport(
            protocol, lambda data: self._send(port, data), lambda: self._protocols.pop(port, None)
        )
        self._protocols[port] = protocol
        protocol.connection_made(transport)
        return transport, protocol

    def run_in_executor(self, executor: Executor | None, func: Callable[..., Any], *args: Any) -> Any:
        """Compute at once; the result is there now, or after `late_s`."""
        future = self.create_future()
        try:
            future.set_result(func(*args))
        except Exception as error:
            future.set_exception(error)
        return future if not self.late_s else self.create_task(self._late(future))

    async def _late(self, future: asyncio.Future[Any]) -> Any:
        await asyncio.sleep(self.late_s)
        return future.result()

    def _send(self, port: int, data: bytes) -> None:
        if port in self.outgoing:
            self.outgoing[port](data)

    def _step_until(self, timeout_s: float | None) -> None:
        """Step the simulator until something arrives or the timeout is over."""
        due_ns = None if timeout_s is None else self._simulated_ns + round(timeout_s * 1e9)
        heard = False
        while not heard and (due_ns is None or self._simulated_ns < due_ns):
            self._simulated_ns = CLOCK_OFFSET_NS + self._advance()
            arrived, self._arrived = self._arrived, []
            for port, data in arrived:
                protocol = self._protocols.get(port)
                if protocol is not None:
                    heard = True
                    protocol.datagram_received(data, SIMULATOR)


class _MemorySelector(selectors.SelectSelector):
    """Selector without files: it steps the simulated time instead of waiting."""

    def __init__(self, step_until: Callable[[float | None], None]) -> None:
        super().__init__()
        self._step_until = step_until

    def select(self, timeout: float | None = None) -> list[tuple[selectors.SelectorKey, int]]:
        if timeout is None or timeout > 0:
            self._step_until(timeout)
        return []


def _port_of(sock: socket.socket) -> int:
    """Return the port of a bound socket, which is closed: nothing comes there."""
    port = int(sock.getsockname()[1])
    sock.close()
    return port
