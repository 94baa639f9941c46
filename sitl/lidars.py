"""The sensors of ground that can be simulated, by name."""

from __future__ import annotations

from typing import Protocol

import numpy as np

from sitl.flash.sensor import FlashSensor
from sitl.mid360 import Mid360
from sitl.ouster import Ouster
from sitl.pulse_lidar import PoseAt
from sitl.radar.sensor import RadarSensor
from sitl.sensor_clock import Clock
from sitl.vlp16 import Vlp16
from sitl.world import World

PORTS = {"mid360": 56301, "vlp16": 2368, "ouster": 7502, "flash": 7610, "radar": 7611}
"""Name of each, and the port to which the real one sends."""


class Sensor(Protocol):
    """What is carried by a vehicle and sends datagrams."""

    clock: Clock

    def step(self, t0_ns: int, t1_ns: int, pose_at: PoseAt, world: World) -> list[bytes]:
        """Measure in [t0_ns, t1_ns) and return what is to be sent."""


def build(name: str, rng: np.random.Generator, point_rate_hz: int) -> Sensor:
    """Return a sensor by its name, one of `PORTS`; of LiDARs `point_rate_hz` pulses are simulated.

    Raises
    ------
    ValueError
        There is none of this name, or it cannot fire so many.
    """
    match name:
        case "mid360":
            return Mid360(rng, point_rate_hz=point_rate_hz)
        case "vlp16":
            return Vlp16(rng, point_rate_hz=point_rate_hz)
        case "ouster":
            return Ouster(rng, point_rate_hz=point_rate_hz)
        case "flash":
            return FlashSensor(rng)
        case "radar":
            return RadarSensor(rng)
    raise ValueError(f"no LiDAR is named {name!r}: there are {', '.join(PORTS)}")
