"""Ouster OS1 with 32 rows: all beams of a column fire at once, returned as the sensor's own packets.

Data sheet (OS1, second generation): 32 rows from +22.5 to -22.5 degrees, 512 columns at 10 Hz; 45 m at 10 %
and 100 m at 80 % reflectivity, precision 1.5 cm.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from sitl.sensors.lidar_mount import Mount
from sitl.sensors.optics import Noise, Reach
from sitl.sensors.ouster_packets import PACKET_COLUMNS, UP_MM, encode_packet, metadata, packet_type
from sitl.sensors.pulse_lidar import PulseLidar, Shots
from sitl.sensors.sensor_clock import Clock

F64 = NDArray[np.float64]
I64 = NDArray[np.int64]

ROWS, COLUMNS, FRAME_NS = 32, 512, 100_000_000
RATE_HZ = ROWS * COLUMNS * 10
ELEVATION_DEG: F64 = np.linspace(22.5, -22.5, ROWS)
REACH = Reach(blind_m=0.3, most_m=120.0, at_10_percent_m=45.0, at_80_percent_m=100.0)
NOISE = Noise(range_sigma_m=0.015, angle_sigma_deg=0.02)
SIDEWAYS = Mount(pitch_deg=90.0)
"""Axis forward, connector up: the head sweeps the ground from side to side."""


class Ouster(PulseLidar):
    """OS1-32 on a moving vehicle.

    Parameters
    ----------
    rng, mount, clock, noise
        See ``PulseLidar``; by default mounted with its axis forward, so that it looks down and to both sides.
    point_rate_hz
        Pulses per second that are traced into the world, in whole columns; the sensor fires 163 840, and the
        others find nothing. None traces all.
    """

    WAVELENGTH_NM = 865

    def __init__(
        self,
        rng: np.random.Generator,
        mount: Mount | None = None,
        *,
        point_rate_hz: int | None = None,
        clock: Clock | None = None,
        noise: Noise | None = None,
    ) -> None:
        super().__init__(rng, mount or SIDEWAYS, clock, noise or NOISE, REACH, PACKET_COLUMNS * ROWS)
        self._every = 1 if point_rate_hz is None else max(1, round(RATE_HZ / point_rate_hz))
        self._layout = packet_type(ROWS)

    @property
    def metadata(self) -> str:
        """Metadata as from the sensor's HTTP API, JSON."""
        return metadata(ELEVATION_DEG, COLUMNS)

    @property
    def group(self) -> int:
        return PACKET_COLUMNS * ROWS

    def fired_ns(self, index: I64) -> I64:
        return index // ROWS * FRAME_NS // COLUMNS

    def pulses_about(self, elapsed_ns: int) -> tuple[int, int]:
        column = elapsed_ns * COLUMNS // FRAME_NS
        return (column - 1) * ROWS, (column + 2) * ROWS

    def directions(self, index: I64) -> F64:
        """Return unit vectors: column 0 points back over the connector, and the head turns clockwise."""
        azimuth = np.pi - (2.0 * np.pi / COLUMNS) * (index // ROWS % COLUMNS)
        elevation = np.radians(ELEVATION_DEG[index % ROWS])
        flat = np.cos(elevation)
        return np.column_stack([flat * np.cos(azimuth), flat * np.sin(azimuth), np.sin(elevation)])

    def origins_m(self, index: I64) -> F64:
        return np.tile([0.0, 0.0, UP_MM * 1e-3], (len(index), 1))

    def is_traced(self, index: I64) -> NDArray[np.bool_] | None:
        return None if self._every == 1 else index // ROWS % self._every == 0

    def encode(self, shots: Shots) -> bytes:
        shape = (PACKET_COLUMNS, ROWS)
        column = shots.index[::ROWS] // ROWS
        ranges = shots.echoes.range_m.reshape(shape)
        reflectivity = np.clip(np.rint(100.0 * shots.bright), 1, 255).astype(np.uint8).reshape(shape)
        frame, first = divmod(int(column[0]), COLUMNS)
        stamps_ns = self.clock.offset_ns + self.fired_ns(shots.index[::ROWS])
        lit = np.where(ranges > 0, reflectivity, 0).astype(np.uint8)
        return encode_packet(self._layout, frame, first, stamps_ns, ranges, lit)
