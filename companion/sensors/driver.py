"""LiDAR drivers by URL."""

from __future__ import annotations

import asyncio
import contextlib
import errno
import logging
import socket
from collections.abc import Callable
from dataclasses import asdict
from typing import Any

from companion.clock import now_ns
from companion.errors import CompanionError, UsageError
from companion.sensors.clock import SensorClock
from companion.sensors.livox import LivoxDecoder
from companion.sensors.returns import Returns
from params import Parameters

log = logging.getLogger(__name__)

BATCH_S = 0.01
BATCH_PACKETS = 64
RECEIVE_BUFFER = 8 << 20
RATE_NS = 1_000_000_000
BIND_ERRORS = {
    errno.EADDRINUSE: "the port is in use",
    errno.EADDRNOTAVAIL: "this computer has no such address: give its own, not the sensor's, or 0.0.0.0",
}
EXAMPLE = "livox:HOST:PORT, such as livox:0.0.0.0:56301"

OnReturns = Callable[[Returns], None]


def open_lidar(url: str, parameters: Parameters, on_returns: OnReturns) -> LivoxDriver:
    """Return the driver for a URL such as `livox:0.0.0.0:56301`; without a host it listens everywhere.

    Raises
    ------
    UsageError
        The URL is malformed or names a sensor that is not supported.
    """
    kind, _, address = url.partition(":")
    if kind in ("velodyne", "ouster"):
        raise UsageError(f"LiDAR {url!r}: {kind} is not supported yet: write {EXAMPLE}")
    if kind != "livox":
        raise UsageError(f"LiDAR {url!r} is no sensor: write {EXAMPLE} (recorded files: slz map)")
    host, _, port = address.rpartition(":")
    if not (port.isascii() and port.isdigit() and 0 < int(port) < 65536):
        raise UsageError(f"LiDAR {url!r} has no port from 1 to 65535: write {EXAMPLE}")
    return LivoxDriver(host.strip("[]") or "0.0.0.0", int(port), parameters, on_returns)


class LivoxDriver(asyncio.DatagramProtocol):
    """Receives point packets on a UDP port and hands on their returns in batches of 10 ms.

    It listens to one sensor: another host's packets are counted as foreign until the first has been silent
    for `lidar_timeout_s`, for two sensors' clocks and counts would mix.
    """

    def __init__(self, host: str, port: int, parameters: Parameters, on_returns: OnReturns) -> None:
        self._address = (host, port)
        self._on_returns = on_returns
        self._decoder = LivoxDecoder()
        self._clock = SensorClock(round(parameters.lidar_delay_ms * 1e6))
        self._timer: asyncio.TimerHandle | None = None
        self._failure: asyncio.Future[None] | None = None
        self._patience_ns = round(parameters.lidar_timeout_s * 1e9)
        self._host: str | None = None
        self._foreign = 0
        self._rate = _Rate()
        self.last_arrival_ns: int | None = None

    async def run(self) -> None:
        """Receive until cancelled.

        Raises
        ------
        UsageError
            The port cannot be bound.
        CompanionError
            The socket failed.
        """
        loop = asyncio.get_running_loop()
        self._failure = loop.create_future()
        transport, _ = await loop.create_datagram_endpoint(lambda: self, sock=self._bound())
        try:
            await self._failure
        finally:
            transport.close()
            if self._timer is not None:
                self._timer.cancel()
                self._timer = None

    def _bound(self) -> socket.socket:
        host, port = self._address
        family = socket.AF_INET6 if ":" in host else socket.AF_INET
        sock = socket.socket(family, socket.SOCK_DGRAM)
        with contextlib.suppress(OSError):
            sock.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, RECEIVE_BUFFER)
        sock.setblocking(False)
        try:
            sock.bind(self._address)
        except OSError as error:
            sock.close()
            why = BIND_ERRORS.get(error.errno or 0) or str(error.strerror or error)
            raise UsageError(f"LiDAR livox:{host}:{port}: {why}") from None
        return sock

    def datagram_received(self, data: bytes, addr: Any) -> None:
        """Keep a packet for the next batch."""
        stamp_ns = self._decoder.check(data)
        if stamp_ns is None:
            return
        arrival_ns = now_ns()
        if not self._is_ours(addr[0], arrival_ns):
            self._foreign += 1
            return
        if self._clock.is_jump(stamp_ns, arrival_ns):
            self._flush()  # the packets before have the clock of before
        self._clock.observe(stamp_ns, arrival_ns)
        self._decoder.take(data)
        self.last_arrival_ns = arrival_ns
        if len(self._decoder) >= BATCH_PACKETS:
            self._flush()
        elif self._timer is None:
            self._timer = asyncio.get_running_loop().call_later(BATCH_S, self._flush)

    def error_received(self, exc: Exception) -> None:
        """Ignore what a peer's closed port answers; nothing is sent from here."""

    def connection_lost(self, exc: Exception | None) -> None:
        """End `run` when the socket failed."""
        if exc is not None:
            self._fail(CompanionError(f"LiDAR socket {self._address[0]}:{self._address[1]} failed: {exc}"))

    def _is_ours(self, host: str, arrival_ns: int) -> bool:
        silent = self.last_arrival_ns is None or arrival_ns - self.last_arrival_ns > self._patience_ns
        if host != self._host and silent:
            log.info("LiDAR at %s", host)
            self._host = host
        return host == self._host

    def _flush(self) -> None:
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None
        try:
            raw = self._decoder.drain()
            if len(raw):
                self._rate.add(now_ns(), len(raw))
                stamps_ns = raw.stamp_ns + self._clock.offset_ns(int(raw.stamp_ns[-1]))
                self._on_returns(Returns(raw.xyz_m, stamps_ns, raw.intensity))
        except Exception as error:
            self._fail(error)

    def _fail(self, error: Exception) -> None:
        if self._failure is not None and not self._failure.done():
            self._failure.set_exception(error)

    def statistics(self) -> dict[str, int | float | None]:
        """Return counters of packets and returns, and of what was dropped and why."""
        return asdict(self._decoder.counters) | {
            "foreign": self._foreign,
            "clock_resets": self._clock.resets,
            "last_arrival_ns": self.last_arrival_ns,
            "rate_hz": self._rate.hz,
        }


class _Rate:
    """Returns a second, over the last whole second in which any came."""

    def __init__(self) -> None:
        self.hz = 0.0
        self._since_ns: int | None = None
        self._count = 0

    def add(self, now_ns: int, count: int) -> None:
        if self._since_ns is None:
            self._since_ns = now_ns
        elapsed_ns = now_ns - self._since_ns
        if elapsed_ns >= RATE_NS:
            self.hz = self._count * 1e9 / elapsed_ns
            self._since_ns, self._count = now_ns, 0
        self._count += count
