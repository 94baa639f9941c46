"""Interferometric radar of a small vehicle in flight: a line every tenth of a second, as a datagram.

A line is recorded in the vehicle's own axes: the beam is across it, on its right. The radar has an inertial
sensor of its own, and an altimeter, which sets the range gate every `BLOCK` lines; both have errors. The
format is our own, little endian:

==============  ====================================================================================
4s B B u16 u32  "SLZR", version 1, looks, bins, number of the line
u64             time, ns of the sensor's clock
f64             carrier, Hz
8 x f32         baseline (m), its tilt (degrees), resolution in range and along the track (m),
                first range, step (m), altitude (m), roll that raises the illuminated side (rad)
f32             size of a unit
i16 x ...       real and imaginary parts (looks, 2 antennas, bins)
==============  ====================================================================================
"""

from __future__ import annotations

import struct

import numpy as np
from numpy.typing import NDArray

from sitl.sensors.lidar_mount import Mount
from sitl.sensors.pulse_lidar import PoseAt
from sitl.sensors.radar.side_looker import PER_SAMPLE, SideLooker
from sitl.sensors.sensor_clock import Clock
from sitl.world.world import World

F64 = NDArray[np.float64]
HEADER = struct.Struct("<4sBBHIQdfffffffff")
LINE_NS = 100_000_000
BLOCK = 8
CARRIER_HZ = 35e9
BASELINE_M, TILT_DEG = 0.10, 90.0
RANGE_M, AZIMUTH_M = 0.15, 0.5
LOOKS = 4
SNR_DB = 16.0
SPARE_M = 3.0
LOWEST_M = 3.0
ALTITUDE_SIGMA_M, ROLL_SIGMA_RAD = 0.05, 3e-4
FULL = 8.0  # clipping amplitude of the converter, in units of the mean
RAYS = 8.0
BODY = Mount((0.0, 0.0, 0.1), 0.0, 0.0, 0.0)


class RadarSensor:
    """Interferometric radar with two antennas on a vehicle."""

    def __init__(self, rng: np.random.Generator, clock: Clock | None = None) -> None:
        self.clock = clock or Clock()
        self._errors, own = rng.spawn(2)
        self._radar = SideLooker(
            own, frequency_hz=CARRIER_HZ, baseline_m=BASELINE_M, tilt_deg=TILT_DEG, range_m=RANGE_M,
            azimuth_m=AZIMUTH_M, looks=LOOKS, snr_db=SNR_DB, rays=RAYS,
        )  # fmt: skip
        self._next = 0
        self._gate: tuple[float, int] | None = None

    def scan(self, t0_ns: int, t1_ns: int, pose_at: PoseAt, world: World) -> list[bytes]:
        """Return the datagrams of the lines recorded in [t0_ns, t1_ns)."""
        packets: list[bytes] = []
        self._next = max(self._next, -(-t0_ns // LINE_NS))
        while self._next * LINE_NS < t1_ns:
            now_ns = self._next * LINE_NS
            position, quat = pose_at(np.array([now_ns], np.int64))
            packet = self._line(position[0] + BODY.lever_enu_m(quat)[0], quat, now_ns, world)
            if packet is not None:
                packets.append(packet)
            self._next += 1
        return packets

    def _line(self, position: F64, quat: F64, now_ns: int, world: World) -> bytes | None:
        axes = BODY.to_enu(np.diag([1.0, -1.0, -1.0]), np.repeat(quat, 3, axis=0))  # ahead, right, down
        ground, _ = world.surface(position[:1], position[1:2])
        altitude = float(position[2] - ground[0])
        if not altitude > LOWEST_M:
            self._gate = None
            return None
        if self._gate is None or self._next % BLOCK == 0:
            self._gate = self._gate_for(altitude)
        first, bins = self._gate
        self._radar.level_m = float(ground[0])
        samples = self._radar.line(position, axes, altitude, first, bins, world)
        measured_m = altitude + ALTITUDE_SIGMA_M * self._errors.standard_normal()
        roll = float(np.arcsin(axes[1, 2])) + ROLL_SIGMA_RAD * self._errors.standard_normal()
        unit = FULL / 32767
        parts = np.clip(np.rint(np.stack([samples.real, samples.imag], axis=-1) / unit), -32767, 32767)
        head = HEADER.pack(
            b"SLZR", 1, LOOKS, bins, self._next & 0xFFFFFFFF, self.clock.sensor_ns(now_ns), CARRIER_HZ,
            BASELINE_M, TILT_DEG, RANGE_M, AZIMUTH_M, first, RANGE_M / PER_SAMPLE, measured_m, roll, unit,
        )  # fmt: skip
        return head + parts.astype("<i2").tobytes()

    def _gate_for(self, altitude: float) -> tuple[float, int]:
        low = altitude / np.cos(self._radar.near_rad) - SPARE_M
        high = altitude / np.cos(self._radar.far_rad) + SPARE_M
        step = RANGE_M / PER_SAMPLE
        first = float(np.float32(max(low, 4 * step)))
        return first, int(np.ceil((high - first) / step))
