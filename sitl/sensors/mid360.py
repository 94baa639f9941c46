"""Livox Mid-360: single pulses into a moving world, returned as the sensor's own packets.

Data sheet: 200 000 pulses/s, field of view 360 x (-7..52) deg, range 40 m at 10 % and 70 m at 80 %
reflectivity, blind below 0.1 m, range precision 2 cm (3 cm very near) and angular precision 0.15 deg, both 1
sigma, false alarms below 0.01 %. One return of a pulse.

The data sheet gives no divergence: 0.03 degrees level and 0.28 upward are those of the maker's HAP (user
manual, table 1.2.1). The width at the window, 5 mm, is an estimate.

Counters: in the protocol document ``udp_cnt`` restarts with each frame; recordings of real sensors show a
free-running ``udp_cnt`` and a ``frame_cnt`` that stays 0. Real behaviour is the default,
``frame_restart=True`` gives the documented one.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from sitl.sensors.lidar_mount import Mount
from sitl.sensors.livox_packets import POINTS_PER_PACKET, DataType, point_data, point_packets
from sitl.sensors.mid360_pattern import directions
from sitl.sensors.optics import Noise, Reach
from sitl.sensors.pulse_lidar import PulseLidar, Shots
from sitl.sensors.sensor_clock import Clock
from sitl.world.wires import Beam

F64 = NDArray[np.float64]
I64 = NDArray[np.int64]
U8 = NDArray[np.uint8]

REACH = Reach(blind_m=0.1, most_m=80.0, at_10_percent_m=40.0, at_80_percent_m=70.0)
BEAM = Beam((0.005, 0.005), (float(np.radians(0.03)), float(np.radians(0.28))))
FRAME_NS = 100_000_000
# Tag bits 2-3 are confidence against rain, fog and dust, bits 4-5 other causes; 1 medium, 2 low.
_TAG_DUST, _TAG_GHOST = np.uint8(1 << 2), np.uint8(1 << 4)


class Mid360(PulseLidar):
    """Mid-360 on a moving vehicle.

    Parameters
    ----------
    rng, mount, clock, noise
        See ``PulseLidar``; the clock is sent as free-running (``time_type`` 0).
    point_rate_hz
        Pulses per second; must divide 10^9. Packets hold 96 points, or fewer at a rate so low that the time
        within a packet would not fit its field (below about 14 500 / s).
    data_type
        Point format on the wire.
    frame_restart
        True: counters as in the protocol document. False: as in real recordings.
    reach
        Range limits.

    Raises
    ------
    ValueError
        If the rate does not divide 10^9.
    """

    beam = BEAM

    def __init__(
        self,
        rng: np.random.Generator,
        mount: Mount | None = None,
        *,
        point_rate_hz: int = 200_000,
        data_type: DataType = DataType.CARTESIAN_32,
        clock: Clock | None = None,
        noise: Noise | None = None,
        frame_restart: bool = False,
        reach: Reach = REACH,
    ) -> None:
        if point_rate_hz <= 0 or 1_000_000_000 % point_rate_hz:
            raise ValueError(f"mid360: point_rate_hz {point_rate_hz} does not divide 1 000 000 000")
        self.data_type = data_type
        self.period_ns = 1_000_000_000 // point_rate_hz
        points_per_packet = min(POINTS_PER_PACKET, 6_553_500 // self.period_ns + 1)
        super().__init__(rng, mount or Mount(), clock, noise or Noise(), reach, points_per_packet)
        self._frame_restart = frame_restart
        self._udp_count = 0
        self._frame = -1

    def fired_ns(self, index: I64) -> I64:
        return index * self.period_ns

    def pulses_about(self, elapsed_ns: int) -> tuple[int, int]:
        count = elapsed_ns // self.period_ns
        return count - 2, count + 2

    def directions(self, index: I64) -> F64:
        return directions(index, self.fired_ns(index))

    def tags(self, shots: Shots) -> U8:
        """Return the tag of each point, (n,): nonzero if the sensor considers it false."""
        e = shots.echoes
        tag = np.zeros(len(shots), np.uint8)
        tag[e.ghost & e.marked] = _TAG_GHOST
        tag[e.dust & e.marked] = _TAG_DUST
        return tag

    def encode(self, shots: Shots) -> list[bytes]:
        tag = self.tags(shots)
        reflectivity = np.minimum(np.maximum(np.rint(150.0 * shots.bright), 1), 150).astype(np.uint8)
        reflectivity[tag != 0] = 3
        reflectivity[shots.echoes.range_m == 0.0] = 0
        data = point_data(self.points_m(shots), reflectivity, tag, self.data_type)
        elapsed = shots.index[:: self.pulses_per_packet] * self.period_ns
        interval_ns = (self.pulses_per_packet - 1) * self.period_ns
        udp, frame = np.array([self._count(begin_ns) for begin_ns in elapsed.tolist()]).T
        return point_packets(self.clock.offset_ns + elapsed, udp, frame, interval_ns, self.data_type, data)

    def _count(self, elapsed_ns: int) -> tuple[int, int]:
        """Return the next ``udp_cnt`` and its ``frame_cnt``, for a packet that begins at a time."""
        frame = elapsed_ns // FRAME_NS if self._frame_restart else 0
        self._udp_count = self._udp_count + 1 if frame == self._frame else 0
        self._frame = frame
        return self._udp_count, frame
