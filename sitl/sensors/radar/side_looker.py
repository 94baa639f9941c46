"""Side-looking radar: partial scatterers of every line, summed into two complex images.

For each line and look, rays sample the world within the beam: a strip as wide as the antenna along the track,
because the ground is in its near zone, and all look angles across. At each hit of a ray is a partial
scatterer with a random phase and the power of its patch (Radar letter, section 3.2);
surfaces without a hit are in shadow.
Each antenna sums them with the exact phase of its own path and the response of a limited bandwidth, and adds
noise. Looks and lines are independent of each other, as with a carrier that changes from pulse to pulse.

Not modelled: multiple reflections, motion within a line, the antenna pattern in elevation, which is assumed
to be shaped so that the response of level ground does not depend on range.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sitl.sensors.radar.backscatter import sigma0
from sitl.world.primitives import Kind
from sitl.world.world import World

F64 = NDArray[np.float64]
C64 = NDArray[np.complex64]
SPEED_OF_LIGHT = 299_792_458.0
FINE = 16  # scatterer bins per range resolution
PER_SAMPLE = 2  # samples per range resolution
RAYS = 24.0  # rays per range resolution, line and look


@dataclass(frozen=True, slots=True)
class Track:
    """Trajectory of the first antenna, one pose per line: (n, 3) ENU, m; the radar looks right.

    heading_rad is the course, clockwise from north; roll_rad (n,) raises the illuminated side.
    """

    position_enu_m: F64
    heading_rad: float
    roll_rad: F64


@dataclass(frozen=True, slots=True)
class RawLines:
    """Samples (lines, looks, 2 antennas, bins) complex64 at ranges `first_m` + k `step_m`, and the track."""

    samples: C64
    first_m: float
    step_m: float
    track: Track


def axes_enu(heading_rad: float, roll_rad: float) -> F64:
    """Return ahead, right and down (rows) of a vehicle whose right side is raised by a roll."""
    c, s = np.cos(heading_rad), np.sin(heading_rad)
    level, up = np.array([c, -s, 0.0]), np.array([0.0, 0.0, 1.0])
    right = np.cos(roll_rad) * level + np.sin(roll_rad) * up
    down = np.sin(roll_rad) * level - np.cos(roll_rad) * up
    return np.array([[s, c, 0.0], right, down])


class SideLooker:
    """Side-looking radar with two antennas.

    Parameters
    ----------
    snr_db
        Signal-to-noise ratio of grass at 45 degrees; other ground follows its cross section.
    near_deg, far_deg
        Illuminated look angles.
    level_m
        Height of the ground for which the recorded ranges are chosen.
    both_transmit
        Whether both antennas transmit; otherwise only the first one does.
    """

    def __init__(
        self,
        rng: np.random.Generator,
        *,
        frequency_hz: float = 35e9,
        baseline_m: float = 0.5,
        tilt_deg: float = 90.0,
        range_m: float = 0.5,
        azimuth_m: float = 0.8,
        looks: int = 4,
        snr_db: float = 13.0,
        near_deg: float = 28.0,
        far_deg: float = 62.0,
        level_m: float = 0.0,
        both_transmit: bool = True,
        roughness_m: float = 7.77e-3,
        rays: float = RAYS,
    ) -> None:
        self._rng, self.rays = rng, rays
        self.wavelength_m = SPEED_OF_LIGHT / frequency_hz
        self.baseline_m, self.tilt_rad = baseline_m, np.radians(tilt_deg)
        self.range_m, self.azimuth_m, self.looks = range_m, azimuth_m, looks
        self.near_rad, self.far_rad, self.level_m = np.radians(near_deg), np.radians(far_deg), level_m
        self.both_transmit, self.roughness_m = both_transmit, roughness_m
        grass = np.array([np.radians(45.0)])
        answer = sigma0(np.array([Kind.GRASS], np.uint8), grass, self.wavelength_m)[0]
        self._unit = 1 / (answer * range_m / np.sin(grass[0]) * azimuth_m)
        self._noise = 10 ** (-snr_db / 10)

    def fly(self, track: Track, world: World) -> RawLines:
        """Record every line of a track."""
        altitude = float(np.mean(track.position_enu_m[:, 2])) - self.level_m
        spare = 6.0
        first = altitude / np.cos(self.near_rad) - spare
        last = altitude / np.cos(self.far_rad) + spare
        bins = int(np.ceil((last - first) / (self.range_m / PER_SAMPLE)))
        lines = [
            self.line(position, axes_enu(track.heading_rad, float(roll)), altitude, first, bins, world)
            for position, roll in zip(track.position_enu_m, track.roll_rad, strict=True)
        ]
        return RawLines(np.stack(lines).astype(np.complex64), first, self.range_m / PER_SAMPLE, track)

    def line(
        self, position: F64, axes: F64, altitude: float, first: float, bins: int, world: World
    ) -> NDArray[np.complex128]:
        """Return the samples (looks, 2, bins) of one line, from range `first` on.

        Parameters
        ----------
        axes
            Rows: the vehicle's ahead, right and down in ENU.
        altitude
            Above ground that is illuminated between the look angles.
        """
        low, high = altitude / np.cos(self.near_rad), altitude / np.cos(self.far_rad)
        per_look = int(self.rays * (high - low) / self.range_m)
        level = self._rng.uniform(low, high, (self.looks, per_look))
        look = np.arccos(altitude / level).ravel()  # from the vehicle's down axis
        ahead, right, down = axes
        rays = np.sin(look)[:, None] * right + np.cos(look)[:, None] * down
        along = self._rng.uniform(-0.5, 0.5, look.size) * self.azimuth_m
        way, kind, cosine = world.trace(position + along[:, None] * ahead, rays, 2 * high)
        kind, cosine, way = self._with_water(position, rays, way, kind, cosine)
        seen = np.isfinite(way)
        spread = altitude / (level.ravel() ** 2 * np.sin(look)) * (high - low) / per_look
        patch = self.azimuth_m * np.nan_to_num(way) * spread / np.maximum(cosine, 0.05)
        strength = sigma0(kind, np.arccos(np.clip(cosine, 0, 1)), self.wavelength_m, self.roughness_m)
        height = np.where(seen, np.sqrt(self._unit * strength * patch), 0.0)
        rough = self.roughness_m * self._rng.standard_normal(look.size)  # small irregularities
        way = np.nan_to_num(way, nan=first) - rough * np.cos(look)
        phase = self._rng.uniform(0, 2 * np.pi, look.size)
        which = np.repeat(np.arange(self.looks), per_look)
        other = self._other_way(way, look)
        k = 2 * np.pi / self.wavelength_m
        paths = (2 * way, 2 * other) if self.both_transmit else (2 * way, way + other)
        images = [self._image(height, phase + k * path, path / 2, which, first, bins) for path in paths]
        return np.stack(images, axis=1)

    def _with_water(
        self, position: F64, rays: F64, way: F64, kind: NDArray[np.uint8], cosine: F64
    ) -> tuple[NDArray[np.uint8], F64, F64]:
        """Set the range of rays that hit water, which `World.trace` reports without a return."""
        wet = (kind == Kind.WATER) & ~np.isfinite(way)
        down = np.maximum(-rays[:, 2], 1e-3)
        way = np.where(wet, (position[2] - self.level_m) / down, way)
        return kind, np.where(wet, down, cosine), way

    def _other_way(self, way: F64, look: F64) -> F64:
        """Return the distances from the second antenna."""
        tilt = self.tilt_rad
        across = way * np.sin(look) - self.baseline_m * np.cos(tilt)
        down = way * np.cos(look) + self.baseline_m * np.sin(tilt)
        return np.asarray(np.hypot(across, down))

    def _image(
        self, height: F64, phase: F64, way: F64, which: NDArray[np.int64], first: float, bins: int
    ) -> NDArray[np.complex128]:
        """Sum the scatterers, limit the bandwidth and add noise; (looks, bins)."""
        step = self.range_m / FINE
        count = bins * FINE // PER_SAMPLE
        place = np.rint((way - first) / step).astype(np.int64)
        inside = (place >= 0) & (place < count)
        flat = which[inside] * count + place[inside]
        value = height[inside] * np.exp(1j * phase[inside])
        total = self.looks * count
        dense = np.bincount(flat, value.real, total) + 1j * np.bincount(flat, value.imag, total)
        noise = self._rng.standard_normal((2, total)) * np.sqrt(self._noise / 2 / FINE)
        dense = (dense + noise[0] + 1j * noise[1]).reshape(self.looks, count)
        spectrum = np.fft.fft(dense, axis=1)
        frequency = np.abs(np.fft.fftfreq(count, step))
        spectrum[:, frequency > 0.5 / self.range_m] = 0
        limited = np.fft.ifft(spectrum, axis=1) * FINE
        return np.asarray(limited[:, :: FINE // PER_SAMPLE][:, :bins])
