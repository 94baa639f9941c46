"""Registry of third-party sensors, whose decoders a user's program adds first (`docs/driver.md`)."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from companion.flight.sensors.packet_stream import Decoder

OURS = frozenset({"livox", "velodyne", "ouster", "flash", "radar", "lightware", "mavlink"})


@dataclass(frozen=True, slots=True)
class OtherSensor:
    """Factory of decoders of a kind of sensor; default_port: its own UDP port, None without one."""

    make: Callable[[], Decoder]
    default_port: int | None


_SENSORS: dict[str, OtherSensor] = {}


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
    if kind in OURS or kind in _SENSORS:
        raise ValueError(f"sensor {kind!r} is there already: take another name")
    if default_port is not None and not 0 < default_port < 65536:
        raise ValueError(f"sensor {kind!r}: default port {default_port} is not from 1 to 65535")
    _SENSORS[kind] = OtherSensor(make, default_port)


def remove_sensor(kind: str) -> None:
    """Undo `add_sensor`; raise KeyError for an unknown kind."""
    del _SENSORS[kind]


def other_sensor(kind: str) -> OtherSensor | None:
    """Return the sensor registered under a name, None if there is none."""
    return _SENSORS.get(kind)
