"""Prism scanner after Neptec's OPAL of the SLZ paper: a rosette within a cone, up to a kilometre.

The paper's Table 3 gives a range of up to 1000 m and a precision of 2 cm. Two counter-rotating prisms fill a
cone. Its width and the prisms' rates are our choice, because the paper does not give them. The maker does not
publish its packets either: the points are sent in Livox packets, which hold the same data, so that `slz run
--lidar livox:` accepts them.
The beam is ours too: 10 mm and 0.3 mrad, as of long-range scanners.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from sitl.sensors.lidar_mount import Mount
from sitl.sensors.mid360 import Mid360
from sitl.sensors.optics import Noise, Reach
from sitl.sensors.sensor_clock import Clock
from sitl.world.wires import Beam

F64 = NDArray[np.float64]
I64 = NDArray[np.int64]

HALF_CONE_DEG = 60.0
PRISMS_HZ = 71.0, -43.7
REACH = Reach(blind_m=1.0, most_m=1000.0, at_10_percent_m=350.0, at_80_percent_m=1000.0)
NOISE = Noise(range_sigma_m=0.02, angle_sigma_deg=0.02)
DOWN = Mount(pitch_deg=90.0)


class Opal(Mid360):
    """OPAL scanner with its x axis in the middle of the cone; by default it looks down.

    Parameters
    ----------
    rng, mount, clock, noise
        See ``PulseLidar``.
    point_rate_hz
        Pulses per second; must divide 10^9.
    """

    beam = Beam((0.01, 0.01), (0.0003, 0.0003))

    def __init__(
        self,
        rng: np.random.Generator,
        mount: Mount | None = None,
        *,
        point_rate_hz: int = 200_000,
        clock: Clock | None = None,
        noise: Noise | None = None,
    ) -> None:
        super().__init__(
            rng, mount or DOWN, point_rate_hz=point_rate_hz, clock=clock, noise=noise or NOISE, reach=REACH
        )

    def directions(self, index: I64) -> F64:
        time_s = self.fired_ns(index) * 1e-9
        first, second = (2.0 * np.pi * (hz * time_s - np.floor(hz * time_s)) for hz in PRISMS_HZ)
        bend = np.radians(HALF_CONE_DEG) / 2
        aside, up = bend * (np.cos(first) + np.cos(second)), bend * (np.sin(first) + np.sin(second))
        angle = np.hypot(aside, up)
        across = np.sinc(angle / np.pi)  # sin(angle) / angle
        return np.column_stack([np.cos(angle), across * aside, across * up])
