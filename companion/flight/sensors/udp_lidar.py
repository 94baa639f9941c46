"""Receiver of a LiDAR's packets on a UDP port."""

from __future__ import annotations

import asyncio
import contextlib
import errno
import logging
import socket
from collections.abc import Iterable
from contextlib import suppress
from pathlib import Path
from typing import Any

from companion.flight.link.transport.multicast import join_group
from companion.flight.sensors.decoders.livox_session import LivoxSession
from companion.flight.sensors.diagnosis.lidar_diagnosis import LidarDiagnosis
from companion.flight.sensors.diagnosis.sensor_surroundings import Surroundings, is_present
from companion.flight.sensors.packet_stream import PacketStream
from companion.runtime.clock import now_ns
from companion.runtime.errors import CompanionError, UsageError

log = logging.getLogger(__name__)

BATCH_S = 0.01
BATCH_PACKETS = 64
LOOK_S = 0.25
BURST_NS = 200_000  # packets that are read closer together wait in the socket, and are read in one go
LONGEST_PACKET = 65_536
RECEIVE_BUFFER = 8 << 20
BIND_ERRORS = {
    errno.EADDRINUSE: "the port is in use; stop the other program (slz run?) that receives from the LiDAR",
    errno.EADDRNOTAVAIL: "this computer has no such address: give its own, not the sensor's, or 0.0.0.0",
}


TABLES = (Path("/proc/net/udp"), Path("/proc/net/udp6"))


def dropped_packets(port: int, tables: Iterable[Path] = TABLES) -> int | None:
    """Return how many packets the kernel has dropped at a port so far; None where it does not say."""
    total: int | None = None
    ending = f":{port:04X}"
    for table in tables:
        with suppress(OSError, ValueError, IndexError):
            for line in table.read_text("ascii").splitlines()[1:]:
                columns = line.split()
                if columns[1].endswith(ending):
                    total = (total or 0) + int(columns[-1])
    return total


class UdpLidar(asyncio.DatagramProtocol):
    """Receiver of packets on a UDP port, in batches of 10 ms.

    Parameters
    ----------
    imu_port
        Port of the sensor's inertial samples, None if it sends none elsewhere. The points do not depend on
        it: if it is in use, one line of the log says so.

    Attributes
    ----------
    stream
        Decoder of the packets.
    on_imu
        Event of inertial samples on the companion's clock, before the returns that arrived with them.
    """

    def __init__(self, host: str, port: int, stream: PacketStream, imu_port: int | None = None) -> None:
        self._address = (host, port)
        self._imu_port = imu_port
        self._timer: asyncio.TimerHandle | None = None
        self._socket: socket.socket | None = None
        self._read_ns = 0
        self._drains = False
        self._failure: asyncio.Future[None] | None = None
        self.stream = stream
        self.on_imu = stream.on_imu
        self.session: LivoxSession | None = None
        stream.diagnosis.surroundings = self._surroundings

    @property
    def diagnosis(self) -> LidarDiagnosis:
        """Diagnosis of stream and clock."""
        return self.stream.diagnosis

    @property
    def last_arrival_ns(self) -> int | None:
        """Arrival of the newest valid packet, None before any."""
        return self.stream.last_arrival_ns

    def statistics(self) -> dict[str, int | float | None]:
        """Return counters of packets and returns, and of dropped data by reason."""
        return self.stream.statistics()

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
        self._socket = self._bound(self._address)
        transport, _ = await loop.create_datagram_endpoint(lambda: self, sock=self._socket)
        inertial = await self._listen_for_imu()
        looks = asyncio.create_task(self._look(), name="lidar diagnosis")
        try:
            await self._until_failed(self._failure)
        finally:
            looks.cancel()
            transport.close()
            if inertial is not None:
                inertial.close()
            self._stop_timer()

    async def _listen_for_imu(self) -> asyncio.BaseTransport | None:
        """Open the port of the inertial samples; None without one."""
        if self._imu_port is None:
            return None
        try:
            sock = self._bound((self._address[0], self._imu_port))
        except UsageError as error:
            log.warning("%s: inertial samples of the LiDAR are not used", error)
            return None
        loop = asyncio.get_running_loop()
        transport, _ = await loop.create_datagram_endpoint(lambda: _ImuPort(self), sock=sock)
        return transport

    async def _look(self) -> None:
        """Let the diagnosis look, also while nothing comes."""
        while True:
            self.diagnosis.check(now_ns())
            await asyncio.sleep(LOOK_S)

    async def _until_failed(self, failure: asyncio.Future[None]) -> None:
        """Wait for a failure, and meanwhile keep the sensor sending."""
        if self.session is None:
            await failure
            return
        session = asyncio.create_task(self.session.run(), name="lidar session")
        try:
            done, _ = await asyncio.wait({failure, session}, return_when=asyncio.FIRST_COMPLETED)
            next(iter(done)).result()
        finally:
            session.cancel()
            await asyncio.gather(session, return_exceptions=True)

    def _bound(self, address: tuple[str, int]) -> socket.socket:
        host, port = address
        family = socket.AF_INET6 if ":" in host else socket.AF_INET
        sock = socket.socket(family, socket.SOCK_DGRAM)
        with contextlib.suppress(OSError):
            sock.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, RECEIVE_BUFFER)
        sock.setblocking(False)
        try:
            sock.bind(address)
            join_group(sock, host)
        except OSError as error:
            sock.close()
            why = BIND_ERRORS.get(error.errno or 0) or str(error.strerror or error)
            raise UsageError(f"LiDAR {self.stream.kind}:{host}:{port}: {why}") from None
        return sock

    def _surroundings(self) -> Surroundings:
        """Return what is known of the sensor beside its packets."""
        host, port = self._address
        dropped = dropped_packets(port)
        if self.session is None:
            return Surroundings(dropped=dropped, bound=host)
        present = is_present(self.session.address)
        return Surroundings(self.session.answers, self.session.refused, present, dropped, host)

    def datagram_received(self, data: bytes, addr: Any) -> None:
        """Take a packet, and soon those that wait behind it: the event loop itself reads one a turn."""
        at_ns = now_ns()
        self.take(data, addr[0], at_ns)
        if at_ns - self._read_ns < BURST_NS and not self._drains:
            self._drains = True
            asyncio.get_running_loop().call_soon(self._drain)
        self._read_ns = at_ns

    def _drain(self) -> None:
        """Take the packets that wait in the socket, at most a batch; its errors are the event loop's."""
        self._drains, sock = False, self._socket
        if sock is None:
            return
        with contextlib.suppress(OSError):
            for _ in range(BATCH_PACKETS):
                data, address = sock.recvfrom(LONGEST_PACKET)
                self.take(data, address[0], now_ns())

    def take(self, packet: bytes, host: str, at_ns: int) -> None:
        """Store a packet for the next batch."""
        try:
            self.stream.add_packet(packet, host, at_ns)
        except Exception as error:
            self._fail(error)
        waiting = len(self.stream)
        if waiting >= BATCH_PACKETS:
            self._flush()
        elif self._timer is None and waiting:
            self._timer = asyncio.get_running_loop().call_later(BATCH_S, self._flush)

    def error_received(self, exc: Exception) -> None:
        """Ignore errors of a peer's closed port; nothing is sent from here."""

    def connection_lost(self, exc: Exception | None) -> None:
        """End `run` if the socket failed."""
        if exc is not None:
            self._fail(CompanionError(f"LiDAR socket {self._address[0]}:{self._address[1]} failed: {exc}"))

    def _flush(self) -> None:
        self._stop_timer()
        try:
            self.stream.flush(now_ns())
        except Exception as error:
            self._fail(error)

    def _stop_timer(self) -> None:
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None

    def _fail(self, error: Exception) -> None:
        if self._failure is not None and not self._failure.done():
            self._failure.set_exception(error)


class _ImuPort(asyncio.DatagramProtocol):
    """Second port of a sensor, whose failure the points survive."""

    def __init__(self, lidar: UdpLidar) -> None:
        self._lidar = lidar

    def datagram_received(self, data: bytes, addr: Any) -> None:
        self._lidar.take(data, addr[0], now_ns())

    def error_received(self, exc: Exception) -> None:
        """Ignore errors of a peer's closed port; nothing is sent from here."""

    def connection_lost(self, exc: Exception | None) -> None:
        if exc is not None:
            log.warning("the port of the LiDAR's inertial samples failed: %s", exc)
