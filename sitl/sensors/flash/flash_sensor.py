"""Flash LiDAR in flight: frames at 8 Hz, pulse energy controlled by the echoes, rows as datagrams.

Makers do not publish the formats of flash cameras, so this format is our own: a datagram is one row of a
frame, little endian, and contains everything needed to read it.

==============  ====================================================================================
4s B B          "SLZF", version 1, zero
4 x u16         rows, columns, samples in a ring, number of the row
u32 u64         number of the frame; time of the flash, ns of the sensor's clock
5 x f32         field of view (degrees), sample (ns), pulse FWHM (ns), dark level, its noise (counts)
2 x u16 u32     clipping level, upper bound of a marker, counter of a pixel never triggered
u32 x columns   counters
u16 x ...       rings, pixel by pixel
==============  ====================================================================================
"""

from __future__ import annotations

import struct
from dataclasses import replace

import numpy as np

from sitl.sensors.flash.focal_plane import FocalPlane, RawFrame
from sitl.sensors.flash.instrument import FlashLidar
from sitl.sensors.lidar_mount import Mount
from sitl.sensors.pulse_lidar import PoseAt
from sitl.sensors.sensor_clock import Clock
from sitl.world.world import World

HEADER = struct.Struct("<4sBBHHHHIQfffffHHI")
FRAME_NS = 125_000_000
WANTED_COUNTS = 1_500.0
BRIGHT = 75.0  # percentile of the pixels whose maximum is controlled
FACTOR = 4.0  # greatest change of the energy from frame to frame
MARKER_COUNTS = 8


class FlashSensor:
    """Flash LiDAR with a wide lens, looking down.

    Parameters
    ----------
    rng
        Source of all noise.
    fov_deg
        Angle across the columns.
    """

    def __init__(self, rng: np.random.Generator, fov_deg: float = 60.0, clock: Clock | None = None) -> None:
        self.clock = clock or Clock()
        plane = replace(FocalPlane(), gate_ticks=1_000)
        self._lidar = FlashLidar(
            rng,
            plane,
            fov_deg=fov_deg,
            full_at_m=18.0,
            mount=Mount((0.1, 0.0, 0.05), 0.0, 90.0, 0.0),
            subpixels=1,
        )
        self._next = 0

    def scan(self, t0_ns: int, t1_ns: int, pose_at: PoseAt, world: World) -> list[bytes]:
        """Return the datagrams of the frames flashed in [t0_ns, t1_ns)."""
        packets: list[bytes] = []
        self._next = max(self._next, -(-t0_ns // FRAME_NS))
        while self._next * FRAME_NS < t1_ns:
            now_ns = self._next * FRAME_NS
            position, quat = pose_at(np.array([now_ns], np.int64))
            stamp_ns = self.clock.sensor_ns(now_ns)
            frame = self._lidar.flash(position[0], quat[0], world, stamp_ns)
            packets += self._packets(frame)
            self._adapt(frame)
            self._next += 1
        return packets

    def _adapt(self, frame: RawFrame) -> None:
        """Set the energy of the next pulse from the echoes of this one."""
        plane = self._lidar.plane
        lit = frame.counter < plane.gate_ticks
        if lit.mean() < 0.1:
            factor = FACTOR
        else:
            high = np.percentile(frame.samples[lit].max(axis=1), BRIGHT) - plane.dark_counts
            factor = float(np.clip(WANTED_COUNTS / max(high, 1.0), 1 / FACTOR, FACTOR))
        self._lidar.energy = float(np.clip(self._lidar.energy * factor, 1e-6, 1e3))

    def _packets(self, frame: RawFrame) -> list[bytes]:
        p = self._lidar.plane
        packets = []
        for row in range(p.rows):
            head = HEADER.pack(
                b"SLZF", 1, 0, p.rows, p.cols, p.n_samples, row, self._next & 0xFFFFFFFF, frame.stamp_ns,
                self._lidar.fov_deg, p.tick_ns, p.pulse_ns, p.dark_counts, p.noise_counts,
                p.full_counts, MARKER_COUNTS, p.gate_ticks,
            )  # fmt: skip
            counter, rings = frame.counter[row].astype("<u4"), frame.samples[row].astype("<u2")
            packets.append(head + counter.tobytes() + rings.tobytes())
        return packets
