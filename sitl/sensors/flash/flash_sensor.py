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
from numpy.typing import NDArray

from sitl.sensors.flash.focal_plane import C_M_NS, FocalPlane, RawFrame
from sitl.sensors.lidar_mount import Mount
from sitl.sensors.pulse_lidar import PoseAt
from sitl.sensors.sensor_clock import Clock
from sitl.world.primitives import REFLECTANCE
from sitl.world.world import World

F64 = NDArray[np.float64]
FARTHEST_M = 1_400.0
HEADER = struct.Struct("<4sBBHHHHIQfffffHHI")
FRAME_NS = 125_000_000
WANTED_COUNTS = 1_500.0
BRIGHT = 75.0  # percentile of the pixels whose maximum is controlled
FACTOR = 4.0  # greatest change of the energy from frame to frame
MARKER_COUNTS = 8


class FlashLidar:
    """Flash LiDAR on a vehicle.

    Parameters
    ----------
    rng
        Source of all noise.
    plane
        The electronics.
    fov_deg
        Angle across the columns; pixels are square.
    full_at_m
        Range at which ground of reflectance 0.27 at normal incidence drives the converter to full scale.
    mount
        x of the sensor is the optical axis, y left, z up in the image.
    subpixels
        Rays along each side of a pixel: a pixel at an edge sees both sides of it.

    Attributes
    ----------
    energy
        Energy of the pulse, relative to the one that `full_at_m` describes.
    """

    def __init__(
        self,
        rng: np.random.Generator,
        plane: FocalPlane | None = None,
        *,
        fov_deg: float = 2.93,
        full_at_m: float = 160.0,
        mount: Mount | None = None,
        subpixels: int = 2,
    ) -> None:
        self.plane = plane or FocalPlane()
        self.fov_deg, self.mount, self._subpixels = fov_deg, mount or Mount((0, 0, 0), 0, 90.0, 0), subpixels
        self._rng = rng
        self.energy = 1.0
        self._gain = (self.plane.full_counts - self.plane.dark_counts) * full_at_m**2 / 0.27
        self._dead = rng.random((self.plane.rows, self.plane.cols)) < self.plane.dead
        self._rays = self._directions()
        # The detectors differ in response, and the laser is brightest in the middle.
        across = np.linspace(-1, 1, self.plane.cols) ** 2 + np.linspace(-1, 1, self.plane.rows)[:, None] ** 2
        self._response: F64 = (1 - 0.12 * across) * (1 + 0.03 * rng.standard_normal(across.shape))

    def _directions(self) -> F64:
        """Return unit vectors (rows * cols * k, 3) of all rays in the sensor frame."""
        p, k = self.plane, self._subpixels
        scale = np.tan(np.radians(self.fov_deg / 2)) * 2 / p.cols
        inside = (np.arange(k) + 0.5) / k - 0.5
        right = (np.arange(p.cols)[:, None] - (p.cols - 1) / 2 + inside).ravel() * scale
        down = (np.arange(p.rows)[:, None] - (p.rows - 1) / 2 + inside).ravel() * scale
        y, z = np.meshgrid(-right, -down)
        by_pixel = np.stack([np.ones_like(y), y, z], axis=2).reshape(p.rows, k, p.cols, k, 3)
        vectors = by_pixel.swapaxes(1, 2).reshape(-1, 3)
        unit: F64 = vectors / np.linalg.norm(vectors, axis=1, keepdims=True)
        return unit

    def flash(self, position_enu_m: F64, quat_wxyz: F64, world: World, stamp_ns: int = 0) -> RawFrame:
        """Fire one pulse from a pose and return the frame recorded by the focal plane.

        Parameters
        ----------
        position_enu_m, quat_wxyz
            Of the vehicle, body FRD -> NED.
        """
        delays, heights = self.echoes(position_enu_m, quat_wxyz, world)
        return self.plane.expose(delays, heights, self._rng, self._dead, stamp_ns)

    def echoes(self, position_enu_m: F64, quat_wxyz: F64, world: World) -> tuple[F64, F64]:
        """Return times (ns) and heights (counts) of the echoes, (rows, cols, rays of a pixel)."""
        p, n = self.plane, self._subpixels**2
        attitude = np.tile(quat_wxyz, (len(self._rays), 1))
        origin = position_enu_m + self.mount.lever_enu_m(attitude[:1])
        origins = np.broadcast_to(origin, (len(self._rays), 3))
        way, kind, cosine = world.trace(origins, self.mount.to_enu(self._rays, attitude), FARTHEST_M)
        way = way.reshape(p.rows, p.cols, n)
        bright = (REFLECTANCE[kind] * cosine).reshape(way.shape) / n
        with np.errstate(divide="ignore", invalid="ignore"):
            height = self.energy * self._gain * bright * self._response[..., None] / way**2
        seen = np.isfinite(way)
        return np.where(seen, 2 * way / C_M_NS, np.inf), np.where(seen, height, 0.0)


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
