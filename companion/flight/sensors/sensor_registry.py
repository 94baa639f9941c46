"""Registry of sensors that send UDP packets: the decoder, default port and metadata of each kind.

A program of the user's can add its own before it calls ours (`docs/driver.md`).
"""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass

from companion.flight.sensors.packet_stream import Decoder
from companion.runtime.errors import UsageError

EXAMPLE = "livox:HOST:PORT (livox:0.0.0.0:56301), velodyne:HOST:PORT or ouster:HOST:PORT?meta=FILE.json"
WITHOUT_PACKETS = frozenset({"lightware", "mavlink"})  # kinds that send no UDP packets


@dataclass(frozen=True, slots=True)
class Sensor:
    """A kind of sensor.

    Attributes
    ----------
    make
        Returns a new decoder from the sensor's metadata, which is empty where it has none.
    default_port
        The maker's UDP port, None without one.
    has_metadata
        Its packets can be decoded only with the sensor's metadata.
    imu_port_step
        The maker's UDP port of inertial samples less that of the points, None if it sends none.
    """

    make: Callable[[str], Decoder]
    default_port: int | None = None
    has_metadata: bool = False
    imu_port_step: int | None = None


def _livox(_: str) -> Decoder:
    from companion.flight.sensors.decoders.livox_decoder import LivoxDecoder

    return LivoxDecoder()


def _velodyne(_: str) -> Decoder:
    # Imported only when used: its library reports leaks when the program ends, on any terminal.
    from companion.flight.sensors.decoders.velodyne_decoder import VelodyneDecoder

    return VelodyneDecoder()


def _ouster(metadata: str) -> Decoder:
    from companion.flight.sensors.decoders.ouster_decoder import OusterDecoder

    return OusterDecoder(metadata)


def _flash(_: str) -> Decoder:
    from companion.flight.sensors.decoders.flash_decoder import FlashDecoder

    return FlashDecoder()


def _radar(_: str) -> Decoder:
    from companion.flight.sensors.decoders.radar_decoder import RadarDecoder

    return RadarDecoder()


def _ros2(metadata: str) -> Decoder:
    from companion.flight.sensors.decoders.ros_cloud_decoder import RosCloudDecoder

    return RosCloudDecoder(metadata)


_OURS = {
    "livox": Sensor(_livox, imu_port_step=100),
    "velodyne": Sensor(_velodyne, 2368),
    "ouster": Sensor(_ouster, 7502, has_metadata=True, imu_port_step=1),
    "flash": Sensor(_flash, 7610),
    "radar": Sensor(_radar, 7611),
    "ros2": Sensor(_ros2),
}
_added: dict[str, Sensor] = {}


def registered(kind: str) -> Sensor | None:
    """Return the sensor of a kind, None if there is none."""
    return _OURS.get(kind) or _added.get(kind)


def decoder_for(kind: str, metadata: str = "") -> Decoder:
    """Return the decoder of a kind of sensor, as in its URL, with the sensor's metadata if it has any.

    Raises
    ------
    UsageError
        The kind is unknown, or the metadata cannot be read.
    """
    sensor = registered(kind)
    if sensor is None:
        raise UsageError(f"LiDAR {kind!r} is no sensor: {EXAMPLE}")
    return sensor.make(metadata)


def add_sensor(kind: str, make: Callable[[], Decoder], default_port: int | None = None) -> None:
    """Register `KIND:HOST:PORT` as the URL of a UDP LiDAR, in all of this process (`--lidar`, replay).

    Parameters
    ----------
    kind
        Lower-case letters, digits and hyphens; the decoder's own `kind`.
    make
        Returns a new decoder.
    default_port
        Used if the URL has no port, 1 to 65535; None: the URL must have one.

    Raises
    ------
    ValueError
        The kind is malformed or already in use, or the port is invalid.
    """
    if not re.fullmatch(r"[a-z][a-z0-9-]*", kind):
        raise ValueError(f"sensor {kind!r}: a kind is lower-case letters, digits and hyphens")
    if kind in WITHOUT_PACKETS or registered(kind) is not None:
        raise ValueError(f"sensor {kind!r} is there already: take another name")
    if default_port is not None and not 0 < default_port < 65536:
        raise ValueError(f"sensor {kind!r}: default port {default_port} is not from 1 to 65535")
    _added[kind] = Sensor(lambda _: make(), default_port)


def remove_sensor(kind: str) -> None:
    """Undo `add_sensor`; raise KeyError for a kind that was not added."""
    del _added[kind]
