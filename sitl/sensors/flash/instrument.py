"""Flash LiDAR instrument: laser, lens and focal plane in front of a world."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from sitl.sensors.flash.focal_plane import C_M_NS, FocalPlane, RawFrame
from sitl.sensors.lidar_mount import Mount
from sitl.world.primitives import REFLECTANCE
from sitl.world.world import World

F64 = NDArray[np.float64]
FARTHEST_M = 1_400.0


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
