"""LiDAR drivers, opened by URL."""

from __future__ import annotations

import ipaddress
import re
from collections.abc import Callable
from pathlib import Path
from typing import Protocol

from companion.flight.link.link import Link
from companion.flight.link.transport.mavlink_url import Url, parse_url
from companion.flight.rmw.ros_session import RosSession
from companion.flight.sensors.decoders.lightware_stream import LightwareStream
from companion.flight.sensors.decoders.livox_session import LivoxSession
from companion.flight.sensors.diagnosis.lidar_diagnosis import LidarDiagnosis
from companion.flight.sensors.imu_samples import ImuSamples
from companion.flight.sensors.mavlink_lidar import MavlinkLidar
from companion.flight.sensors.packet_stream import Batch, OnReturns, PacketStream
from companion.flight.sensors.ros_lidar import RosLidar
from companion.flight.sensors.sensor_registry import EXAMPLE, decoder_for, registered
from companion.flight.sensors.serial_lidar import SerialLidar
from companion.flight.sensors.udp_lidar import UdpLidar
from companion.runtime.errors import UsageError
from companion.runtime.event import Event
from params import Parameters

LINE = "lightware:/dev/ttyUSB0,921600"
CONTROLLED = "livox:0.0.0.0:56301?sensor=192.168.1.100, the address on the sensor's label"
_TOPIC = re.compile(r"(/[A-Za-z_]\w*)+", re.ASCII)
INERTIAL = "livox:0.0.0.0:56301?imu=56401"
CLOUDS = "ros2:/TOPIC of sensor_msgs/PointCloud2, with --ros2 (docs/ros2.md)"
NAMES_METADATA = "ouster:HOST:PORT?meta=FILE.json, the file from http://SENSOR/api/v1/sensor/metadata"


class Lidar(Protocol):
    """Source of returns, and of the inertial samples of a sensor that has such a unit.

    Attributes
    ----------
    on_imu
        Event of inertial samples on the companion's clock, before the returns that arrived with them.
    """

    on_imu: Event[[ImuSamples]]

    @property
    def stream(self) -> HasBatches:
        """Source of raw batches for a recording."""

    @property
    def last_arrival_ns(self) -> int | None:
        """Arrival of the newest data, None before any."""

    @property
    def diagnosis(self) -> LidarDiagnosis | None:
        """Diagnosis of stream and clock; None for a sensor that is not diagnosed."""

    def statistics(self) -> dict[str, int | float | None]:
        """Return counters."""

    async def run(self) -> None:
        """Receive until cancelled."""


class HasBatches(Protocol):
    """Source of undecoded batches, with the kind and metadata of its sensor."""

    batches: Event[[Batch]]

    @property
    def kind(self) -> str:
        """Name in the sensor URL."""

    @property
    def metadata(self) -> str:
        """The sensor's metadata, empty if its data need none."""


def open_lidar(
    url: str,
    parameters: Parameters,
    on_returns: OnReturns,
    link: Link | None = None,
    wall_offset_ns: Callable[[], int] | None = None,
    ros: RosSession | None = None,
) -> Lidar:
    """Return the driver for a URL such as `livox:0.0.0.0:56301`; without a host it binds all addresses.

    The port of a Velodyne or Ouster defaults to the maker's. `imu=PORT` names the port of the inertial
    samples of a Mid-360 or Ouster; by default it is as far from that of the points as the maker's.

    Parameters
    ----------
    link
        For `mavlink:`, the ranges of the autopilot's own sensors.
    wall_offset_ns
        Returns the offset of UTC from the companion's clock; measured by default.
    ros
        For `ros2:`, the session of the node.

    Raises
    ------
    UsageError
        The URL is malformed, the sensor is not supported, or the sensor's metadata is missing.
    """
    kind, _, rest = url.partition(":")
    if kind == "mavlink" and link is not None:
        return MavlinkLidar(link, parameters, on_returns)
    if kind == "lightware":
        return SerialLidar(_line(url, rest), LightwareStream(parameters, on_returns))
    if kind == "ros2":
        return _ros_lidar(url, rest, parameters, on_returns, wall_offset_ns, ros)
    known = registered(kind)
    if known is None:
        raise UsageError(f"LiDAR {url!r} is no sensor: write {EXAMPLE} (recorded files: slz map)")
    address, _, query = rest.partition("?")
    default = known.default_port
    host, colon, port = address.rpartition(":")
    if default is not None and not (colon and port):
        host, port = (host if colon else address), str(default)
    if host == "255.255.255.255":
        raise UsageError(f"LiDAR {url!r}: broadcasts arrive at all addresses: use 0.0.0.0")
    if not _is_port(port):
        raise UsageError(f"LiDAR {url!r} has no port from 1 to 65535: write {EXAMPLE}")
    imu_port = None if known.imu_port_step is None else int(port) + known.imu_port_step
    if imu_port is not None:
        query, imu_port = _imu_port(url, query, imu_port)
    try:
        metadata = "" if kind == "livox" else read_metadata(kind, query)
    except UsageError as error:
        raise UsageError(f"LiDAR {url!r}: {error}") from None
    sensor = _sensor(url, query) if kind == "livox" and query else None
    named = None if sensor is None else sensor.partition(":")[0]
    stream = PacketStream(decoder_for(kind, metadata), parameters, on_returns, wall_offset_ns, named)
    lidar = UdpLidar(host.strip("[]") or "0.0.0.0", int(port), stream, imu_port)
    if sensor is not None:
        lidar.session = LivoxSession(sensor, int(port), lambda: lidar.last_arrival_ns, imu_port)
    return lidar


def _ros_lidar(
    url: str,
    rest: str,
    parameters: Parameters,
    on_returns: OnReturns,
    wall_offset_ns: Callable[[], int] | None,
    ros: RosSession | None,
) -> RosLidar:
    """Return the driver for a topic, as `ros2:/points` or `ros2:/depth/points?instant`."""
    topic, _, query = rest.partition("?")
    if not _TOPIC.fullmatch(topic) or query not in ("", "instant"):
        raise UsageError(f"LiDAR {url!r} is no topic: write {CLOUDS}")
    if ros is None:
        raise UsageError(f"LiDAR {url!r} needs --ros2: write {CLOUDS}")
    stream = PacketStream(decoder_for("ros2", query), parameters, on_returns, wall_offset_ns)
    return RosLidar(ros, topic, stream)


def stream_for(
    kind: str, metadata: str, parameters: Parameters, on_returns: OnReturns, wall_offset_ns: int
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
    return PacketStream(decoder_for(kind, metadata), parameters, on_returns, lambda: wall_offset_ns)


def _line(url: str, device: str) -> Url:
    """Return the serial device in a URL."""
    try:
        line = parse_url(device)
    except UsageError as error:
        raise UsageError(f"LiDAR {url!r}: {error}".replace("MAVLink URL ", "")) from None
    if line.kind != "serial":
        raise UsageError(f"LiDAR {url!r} is on a serial line: write {LINE}")
    return line


def _is_port(text: str) -> bool:
    return text.isascii() and text.isdigit() and len(text) <= 5 and 0 < int(text) < 65536


def _imu_port(url: str, query: str, usual: int) -> tuple[str, int | None]:
    """Return a URL's query without `imu=PORT`, and that port; None if the usual one is beyond the last."""
    parts = query.split("&")
    ports = [part.removeprefix("imu=") for part in parts if part.startswith("imu=")]
    if not ports:
        return query, usual if usual < 65536 else None
    if len(ports) > 1 or not _is_port(ports[0]):
        raise UsageError(f"LiDAR {url!r}: imu= is one port from 1 to 65535, as in {INERTIAL}")
    return "&".join(part for part in parts if not part.startswith("imu=")), int(ports[0])


def _sensor(url: str, query: str) -> str:
    """Return the Mid-360's own address, the destination of commands."""
    name, _, address = query.partition("=")
    host, colon, port = address.partition(":")
    try:
        ipaddress.IPv4Address(host)
    except ValueError:
        host = ""
    if name != "sensor" or not host or (colon and not _is_port(port)):
        raise UsageError(f"LiDAR {url!r}: {'?' + query!r} is not understood: write {CONTROLLED}")
    return address


def read_metadata(kind: str, query: str) -> str:
    """Return the sensor's metadata from `meta=FILE`; empty for a sensor that needs none.

    Raises
    ------
    UsageError
        It is missing, cannot be read, or is given for a sensor without metadata.
    """
    name, _, path = query.partition("=")
    known = registered(kind)
    if known is None or not known.has_metadata:
        if query:
            raise UsageError(f"{'?' + query!r} is not understood: write {EXAMPLE}")
        return ""
    if name != "meta" or not path:
        raise UsageError(f"no metadata is named: write {NAMES_METADATA}")
    try:
        return Path(path).read_text("utf-8")
    except OSError as error:
        raise UsageError(f"{path if path.isprintable() else repr(path)}: {error.strerror}") from None
    except ValueError:  # not text, or an impossible file name
        raise UsageError(f"{path if path.isprintable() else repr(path)}: is no text") from None
