"""Velodyne VLP-16: sixteen lasers on a rotating head, returned as the sensor's own packets.

User manual (63-9243): 16 lasers from -15 to +15 degrees, a firing sequence every 55.296 us with 2.304 us from
laser to laser, 600 turns a minute, so 0.2 degrees from sequence to sequence. Range 100 m for good reflectors;
accuracy 3 cm, interpreted as two sigma. Beams are 12.7 x 9.5 mm at the lens and diverge by 3.0 mrad level and
1.5 mrad upward, read as full widths at half maximum.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from sitl.sensors.lidar_mount import Mount
from sitl.sensors.optics import Noise, Reach
from sitl.sensors.pulse_lidar import PulseLidar, Shots
from sitl.sensors.sensor_clock import Clock
from sitl.sensors.velodyne_packets import BLOCKS, CHANNELS, LASERS, ReturnMode, encode_packets
from sitl.world.wires import Beam

F64 = NDArray[np.float64]
I64 = NDArray[np.int64]

LASER_NS, SEQUENCE_NS, TURN_NS = 2_304, 55_296, 100_000_000
RATE_HZ = LASERS * 1e9 / SEQUENCE_NS
# By laser, in firing order: the manual's elevations and vertical corrections.
ELEVATION_DEG: F64 = np.array(
    [-15.0, 1.0, -13.0, 3.0, -11.0, 5.0, -9.0, 7.0, -7.0, 9.0, -5.0, 11.0, -3.0, 13.0, -1.0, 15.0]
)
ELEVATION = np.radians(ELEVATION_DEG)
UP_M: F64 = 1e-3 * np.array(
    [11.2, -0.7, 9.7, -2.2, 8.1, -3.7, 6.6, -5.1, 5.1, -6.6, 3.7, -8.1, 2.2, -9.7, 0.7, -11.2]
)
REACH = Reach(blind_m=0.4, most_m=120.0, at_10_percent_m=50.0, at_80_percent_m=100.0)
NOISE = Noise(range_sigma_m=0.015, angle_sigma_deg=0.08, row_sigma_m=0.001)
BEAM = Beam((0.0127, 0.0095), (0.003, 0.0015))
SIDEWAYS = Mount(pitch_deg=90.0)
"""Axis forward, azimuth 0 down: the head sweeps the ground from side to side."""


class Vlp16(PulseLidar):
    """VLP-16 on a moving vehicle.

    Parameters
    ----------
    rng, mount, clock, noise
        See ``PulseLidar``; by default mounted with its axis forward, so that it looks down and to both sides.
    point_rate_hz
        Pulses per second that are traced into the world; the sensor fires 289 352. The packets of the others
        are not sent, because they would report rays without a return. None traces all.
    mode
        Strongest return, last return, or both: the last, and the strongest or second strongest.
    """

    beam = BEAM

    def __init__(
        self,
        rng: np.random.Generator,
        mount: Mount | None = None,
        *,
        point_rate_hz: int | None = None,
        mode: ReturnMode = ReturnMode.STRONGEST,
        clock: Clock | None = None,
        noise: Noise | None = None,
    ) -> None:
        self.mode = mode
        self._blocks = BLOCKS // 2 if mode is ReturnMode.DUAL else BLOCKS
        pulses = self._blocks * CHANNELS
        super().__init__(rng, mount or SIDEWAYS, clock, noise or NOISE, REACH, pulses)
        self._every = 1 if point_rate_hz is None else max(1, round(RATE_HZ / point_rate_hz))

    @property
    def group(self) -> int:
        return CHANNELS if self._every == 1 else self.pulses_per_packet

    @property
    def rows(self) -> int:
        return LASERS

    def fired_ns(self, index: I64) -> I64:
        return index // LASERS * SEQUENCE_NS + index % LASERS * LASER_NS

    def pulses_about(self, elapsed_ns: int) -> tuple[int, int]:
        sequence = elapsed_ns // SEQUENCE_NS
        return (sequence - 1) * LASERS, (sequence + 2) * LASERS

    def azimuth_deg(self, index: I64) -> F64:
        """Return azimuths of pulses, clockwise seen from above, 0 to 360."""
        return np.asarray(self.fired_ns(index) % TURN_NS * (360.0 / TURN_NS), np.float64)

    def directions(self, index: I64) -> F64:
        azimuth, laser = np.radians(self.azimuth_deg(index)), index % LASERS
        flat, up = np.cos(ELEVATION)[laser], np.sin(ELEVATION)[laser]
        return np.column_stack([flat * np.cos(azimuth), -flat * np.sin(azimuth), up])

    def origins_m(self, index: I64) -> F64:
        up = UP_M[index % LASERS]
        return np.column_stack([np.zeros((len(index), 2)), up])

    def is_traced(self, index: I64) -> NDArray[np.bool_] | None:
        return None if self._every == 1 else index // self.pulses_per_packet % self._every == 0

    def encode(self, shots: Shots) -> list[bytes]:
        first = shots.index[:: self.pulses_per_packet]
        sent = first // self.pulses_per_packet % self._every == 0
        e, dual = shots.echoes, self.mode is ReturnMode.DUAL
        measured = (e.range_m, shots.bright), (e.behind_m, e.behind_bright), (e.other_m, e.other_bright)
        shape = (-1, self._blocks, CHANNELS)
        ranges, bright = (
            [values.reshape(shape)[sent] for values in of_all] for of_all in zip(*measured, strict=True)
        )
        azimuth = self.azimuth_deg(shots.index[::CHANNELS]).reshape(-1, self._blocks)[sent]
        if dual:
            # Where the last is the strongest, the second strongest takes the other place: dust, or leaves.
            last = np.where(ranges[1] > 0, ranges[1], ranges[0])
            pairs = (last, ranges[2]), (bright[1], bright[2])
            range_m, share = (np.stack(pair, axis=2).reshape(-1, BLOCKS, CHANNELS) for pair in pairs)
            azimuth = np.repeat(azimuth, 2, axis=1)
        else:
            which = int(self.mode is ReturnMode.LAST)
            range_m, share = ranges[which], bright[which]
        stamps_ns = self.clock.offset_ns + self.fired_ns(first[sent])
        return encode_packets(stamps_ns, azimuth, range_m, _reflectivity(share), self.mode)


def _reflectivity(bright: F64) -> NDArray[np.uint8]:
    """Return the manual's scale: diffuse reflectors of 0 to 100 % give 0 to 100."""
    return np.clip(np.rint(100.0 * bright), 1, 100).astype(np.uint8)
