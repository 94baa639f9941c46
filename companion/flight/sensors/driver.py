"""LiDAR drivers, opened by URL."""

from __future__ import annotations

import asyncio
import contextlib
import errno
import ipaddress
import socket
from collections.abc import Callable
from pathlib import Path
from typing import Any, Protocol

from companion.flight.link.link import Link
from companion.flight.link.transport.mavlink_url import Url, parse_url
from companion.flight.sensors.decoders.lightware_stream import LightwareStream
from companion.flight.sensors.decoders.livox_decoder import LivoxDecoder
from companion.flight.sensors.decoders.livox_session import LivoxSession
from companion.flight.sensors.decoders.ouster_decoder import OusterDecoder
from companion.flight.sensors.mavlink_lidar import MavlinkLidar
from companion.flight.sensors.packet_stream import Batch, Decoder, OnReturns, PacketStream
from companion.flight.sensors.sensor_registry import other_sensor
from companion.flight.sensors.serial_lidar import SerialLidar
from companion.runtime.clock import now_ns
from companion.runtime.errors import CompanionError, UsageError
from companion.runtime.event import Event
from params import Parameters

BATCH_S = 0.01
BATCH_PACKETS = 64
RECEIVE_BUFFER = 8 << 20
BIND_ERRORS = {
    errno.EADDRINUSE: "the port is in use",
    errno.EADDRNOTAVAIL: "this computer has no such address: give its own, not the sensor's, or 0.0.0.0",
}
LINE = "lightware:/dev/ttyUSB0,921600"
CONTROLLED = "livox:0.0.0.0:56301?sensor=192.168.1.100, the address on the sensor's label"
EXAMPLE = "livox:HOST:PORT (livox:0.0.0.0:56301), velodyne:HOST:PORT or ouster:HOST:PORT?meta=FILE.json"
METADATA = "ouster:HOST:PORT?meta=FILE.json, the file from http://SENSOR/api/v1/sensor/metadata"
DEFAULT_PORTS = {"livox": None, "velodyne": 2368, "ouster": 7502, "flash": 7610, "radar": 7611}


class Lidar(Protocol):
    """Source of returns."""

    @property
    def stream(self) -> HasBatches:
        """Source of raw batches for a recording."""

    @property
    def last_arrival_ns(self) -> int | None:
        """Arrival of the newest data, None before any."""

    def statistics(self) -> dict[str, int | float | None]:
        """Return counters."""

    async def run(self) -> None:
        """Receive until cancelled."""


class HasBatches(Protocol):
    """Source of undecoded batches, with the kind and description of its sensor."""

    batches: Event[[Batch]]

    @property
    def kind(self) -> str:
        """Name in the sensor URL."""

    @property
    def setup(self) -> str:
        """The sensor's metadata, empty if its data need none."""


def open_lidar(
    url: str,
    parameters: Parameters,
    on_returns: OnReturns,
    link: Link | None = None,
    wall_offset_ns: Callable[[], int] | None = None,
) -> Lidar:
    """Return the driver for a URL such as `livox:0.0.0.0:56301`; without a host it binds all addresses.

    The port of a Velodyne or Ouster defaults to the maker's.

    Parameters
    ----------
    link
        For `mavlink:`, the ranges of the autopilot's own sensors.
    wall_offset_ns
        Returns the offset of UTC from the companion's clock; measured by default.

    Raises
    ------
    UsageError
        The URL is malformed, the sensor is not supported, or the sensor's description is missing.
    """
    kind, _, rest = url.partition(":")
    if kind == "mavlink" and link is not None:
        return MavlinkLidar(link, parameters, on_returns)
    if kind == "lightware":
        return SerialLidar(_line(url, rest), LightwareStream(parameters, on_returns))
    other = other_sensor(kind)
    if kind not in DEFAULT_PORTS and other is None:
        raise UsageError(f"LiDAR {url!r} is no sensor: write {EXAMPLE} (recorded files: slz map)")
    address, _, query = rest.partition("?")
    default = DEFAULT_PORTS[kind] if other is None else other.default_port
    host, colon, port = address.rpartition(":")
    if default is not None and not (colon and port):
        host, port = (host if colon else address), str(default)
    if not (port.isascii() and port.isdigit() and len(port) <= 5 and 0 < int(port) < 65536):
        raise UsageError(f"LiDAR {url!r} has no port from 1 to 65535: write {EXAMPLE}")
    try:
        setup = "" if kind == "livox" else description(kind, query)
    except UsageError as error:
        raise UsageError(f"LiDAR {url!r}: {error}") from None
    sensor = _sensor(url, query) if kind == "livox" and query else None
    named = None if sensor is None else sensor.partition(":")[0]
    stream = PacketStream(decoder_for(kind, setup), parameters, on_returns, wall_offset_ns, named)
    lidar = UdpLidar(host.strip("[]") or "0.0.0.0", int(port), stream)
    if sensor is not None:
        lidar.session = LivoxSession(sensor, int(port), lambda: lidar.last_arrival_ns)
    return lidar


def stream_for(
    kind: str, setup: str, parameters: Parameters, on_returns: OnReturns, wall_offset_ns: int
) -> PacketStream | LightwareStream:
    """Return the decoding stream for recorded data of a kind of sensor.

    wall_offset_ns: offset of UTC from the companion's clock.

    Raises
    ------
    UsageError
        The kind is unknown.
    """
    if kind == "lightware":
        return LightwareStream(parameters, on_returns)
    return PacketStream(decoder_for(kind, setup), parameters, on_returns, lambda: wall_offset_ns)


def _line(url: str, device: str) -> Url:
    """Return the serial device in a URL."""
    try:
        line = parse_url(device)
    except UsageError as error:
        raise UsageError(f"LiDAR {url!r}: {error}".replace("MAVLink URL ", "")) from None
    if line.kind != "serial":
        raise UsageError(f"LiDAR {url!r} is on a serial line: write {LINE}")
    return line


def _sensor(url: str, query: str) -> str:
    """Return the Mid-360's own address, the destination of commands."""
    name, _, address = query.partition("=")
    host, colon, port = address.partition(":")
    try:
        ipaddress.IPv4Address(host)
    except ValueError:
        host = ""
    sound = not colon or (port.isascii() and port.isdigit() and len(port) <= 5 and 0 < int(port) < 65536)
    if name != "sensor" or not host or not sound:
        raise UsageError(f"LiDAR {url!r}: {'?' + query!r} is not understood: write {CONTROLLED}")
    return address


def description(kind: str, query: str) -> str:
    """Return the sensor's metadata from `meta=FILE`; empty for a sensor that needs none.

    Raises
    ------
    UsageError
        It is missing, cannot be read, or is given for a sensor without metadata.
    """
    name, _, path = query.partition("=")
    if kind != "ouster":
        if query:
            raise UsageError(f"{'?' + query!r} is not understood: write {EXAMPLE}")
        return ""
    if name != "meta" or not path:
        raise UsageError(f"no metadata is named: write {METADATA}")
    try:
        return Path(path).read_text()
    except OSError as error:
        raise UsageError(f"{path if path.isprintable() else repr(path)}: {error.strerror}") from None
    except ValueError:  # not text, or an impossible file name
        raise UsageError(f"{path if path.isprintable() else repr(path)}: is no text") from None


def decoder_for(kind: str, setup: str = "") -> Decoder:
    """Return the decoder of a kind of sensor, as in its URL, with the sensor's metadata if it has any.

    Raises
    ------
    UsageError
        The kind is unknown, or the metadata cannot be read.
    """
    match kind:
        case "livox":
            return LivoxDecoder()
        case "velodyne":
            # Imported only when used: its library reports leaks when the program ends, on any terminal.
            from companion.flight.sensors.decoders.velodyne_decoder import VelodyneDecoder

            return VelodyneDecoder()
        case "ouster":
            return OusterDecoder(setup)
        case "flash":
            from companion.flight.sensors.decoders.flash_decoder import FlashDecoder

            return FlashDecoder()
        case "radar":
            from companion.flight.sensors.decoders.radar_decoder import RadarDecoder

            return RadarDecoder()
    if (other := other_sensor(kind)) is not None:
        return other.make()
    raise UsageError(f"LiDAR {kind!r} is no sensor: {EXAMPLE}")


class UdpLidar(asyncio.DatagramProtocol):
    """Receiver of packets on a UDP port, in batches of 10 ms.

    Attributes
    ----------
    stream
        Decoder of the packets.
    """

    def __init__(self, host: str, port: int, stream: PacketStream) -> None:
        self._address = (host, port)
        self._timer: asyncio.TimerHandle | None = None
        self._failure: asyncio.Future[None] | None = None
        self.stream = stream
        self.session: LivoxSession | None = None

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
        transport, _ = await loop.create_datagram_endpoint(lambda: self, sock=self._bound())
        try:
            await self._until_failed(self._failure)
        finally:
            transport.close()
            self._stop_timer()

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
            raise UsageError(f"LiDAR {self.stream.kind}:{host}:{port}: {why}") from None
        return sock

    def datagram_received(self, data: bytes, addr: Any) -> None:
        """Store a packet for the next batch."""
        try:
            self.stream.add_packet(data, addr[0], now_ns())
        except Exception as error:
            self._fail(error)
        if len(self.stream) >= BATCH_PACKETS:
            self._flush()
        elif self._timer is None and len(self.stream):
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
