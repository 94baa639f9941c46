"""The LiDARs that can be simulated, by name."""

from __future__ import annotations

import numpy as np

from sitl.mid360 import Mid360
from sitl.ouster import Ouster
from sitl.pulse_lidar import PulseLidar
from sitl.vlp16 import Vlp16

PORTS = {"mid360": 56301, "vlp16": 2368, "ouster": 7502}
"""Name of each, and the port to which the real one sends."""


def build(name: str, rng: np.random.Generator, point_rate_hz: int) -> PulseLidar:
    """Return a LiDAR by its name, one of `PORTS`, that looks down; `point_rate_hz` pulses are simulated.

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
    raise ValueError(f"no LiDAR is named {name!r}: there are {', '.join(PORTS)}")
