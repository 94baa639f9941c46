"""Registry of the simulated sensors of the ground, by name."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from sitl.sensors.flash.flash_sensor import FlashSensor
from sitl.sensors.lidar_port import PTY, Address, LidarPort, Sensor, SerialPort, UdpPort
from sitl.sensors.mid360 import Mid360
from sitl.sensors.opal import Opal
from sitl.sensors.ouster_os1 import OS0, OS1, Ouster
from sitl.sensors.particles import AIR
from sitl.sensors.pulse_lidar import PulseLidar
from sitl.sensors.radar.radar_sensor import RadarSensor
from sitl.sensors.sf45 import Sf45
from sitl.sensors.velodyne_packets import ReturnMode
from sitl.sensors.vlp16 import Vlp16

DEFAULTS = {
    "mid360": "127.0.0.1:56301",
    "vlp16": "127.0.0.1:2368",
    "opal": "127.0.0.1:56301",
    "ouster": "127.0.0.1:7502",
    "os0": "127.0.0.1:7502",
    "flash": "127.0.0.1:7610",
    "radar": "127.0.0.1:7611",
    "sf45": PTY,
}
"""Name and data destination of each: the port that the real one uses, or a pseudo-terminal."""
PERIODIC = frozenset({"mid360", "opal"})
"""LiDARs whose pulse period is a whole number of ns; the others take any rate, or have their own."""

PULSED = ("mid360", "vlp16", "opal", "ouster", "os0")
"""LiDARs of single pulses over a wide view, which can fly a survey."""
OUSTERS = {"ouster": OS1, "os0": OS0}
DUAL = frozenset({"vlp16", *OUSTERS})
"""LiDARs that can send two returns of a pulse."""


def rates_beside(rate_hz: int) -> tuple[int, int]:
    """Return the nearest rates below and above that divide 10^9."""
    below = next(rate for rate in range(rate_hz, 0, -1) if 10**9 % rate == 0)
    above = next(rate for rate in range(rate_hz, 10**9 + 1) if 10**9 % rate == 0)
    return below, above


def open_port(
    name: str, rng: np.random.Generator, point_rate_hz: int, to: Address, dual: bool = False
) -> LidarPort:
    """Return a downward-looking LiDAR by its name, with its output opened.

    Parameters
    ----------
    name
        One of `DEFAULTS`.
    point_rate_hz
        Simulated pulses per second; an SF45 uses the rate requested from it.
    to
        Destination of the kind that the sensor needs.
    dual
        Whether two returns of a pulse are sent, by those of `DUAL`.

    Raises
    ------
    ValueError
        The name is unknown, the rate impossible, the destination of the wrong kind, or a second return not
        among what the sensor sends.
    """
    if dual and name not in DUAL:
        raise ValueError(f"LiDAR {name} sends one return: {', '.join(sorted(DUAL))} can send two")
    if isinstance(to, str) != (name == "sf45"):
        raise ValueError(f"LiDAR {name} sends to {'a serial device' if name == 'sf45' else 'HOST:PORT'}")
    if isinstance(to, str):
        return SerialPort(Sf45(rng), to)
    return UdpPort(_build(name, rng, point_rate_hz, dual), to)


def build_pulsed(name: str, rng: np.random.Generator, point_rate_hz: int) -> PulseLidar:
    """Return a downward-looking LiDAR that fires pulses by its name, without an output; one return of each.

    Raises
    ------
    ValueError
        The name is unknown or that of a sensor that fires none, or the rate impossible.
    """
    sensor = Sf45(rng) if name == "sf45" else _build(name, rng, point_rate_hz, dual=False)
    if not isinstance(sensor, PulseLidar) or name == "sf45":
        raise ValueError(f"LiDAR {name!r} maps no ground by pulses: there are {', '.join(PULSED)}")
    return sensor


def fill_air(port: LidarPort, air: str) -> None:
    """Let a LiDAR that fires pulses see the particles of some air, one of `AIR`.

    Raises
    ------
    ValueError
        It fires none, or the air is unknown.
    """
    if air not in AIR:
        raise ValueError(f"air {air!r}: there are {', '.join(AIR)}")
    sensor = port.sensor
    if not isinstance(sensor, PulseLidar):
        raise ValueError("air: only a LiDAR that fires pulses sees particles")
    sensor.noise = replace(sensor.noise, particles=AIR[air])


def _build(name: str, rng: np.random.Generator, point_rate_hz: int, dual: bool) -> Sensor:
    match name:
        case "mid360":
            return Mid360(rng, point_rate_hz=point_rate_hz)
        case "opal":
            return Opal(rng, point_rate_hz=point_rate_hz)
        case "vlp16":
            mode = ReturnMode.DUAL if dual else ReturnMode.STRONGEST
            return Vlp16(rng, point_rate_hz=point_rate_hz, mode=mode)
        case "ouster" | "os0":
            return Ouster(rng, point_rate_hz=point_rate_hz, model=OUSTERS[name], dual=dual)
        case "flash":
            return FlashSensor(rng)
        case "radar":
            return RadarSensor(rng)
    raise ValueError(f"no LiDAR is named {name!r}: there are {', '.join(DEFAULTS)}")
