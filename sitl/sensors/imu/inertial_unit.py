"""Inertial measurement unit inside a LiDAR: rates and specific force of the true motion, with its errors.

Livox Mid-360: ICM-40609-D, 200 Hz, at (11.0, 23.29, -44.12) mm in the frame of the points, with its axes
(user manual). Gyroscope 4.5 mdps/sqrt(Hz), accelerometer 100 ug/sqrt(Hz) (DS-000330). Ouster OS1 and OS0:
IAM-20680 class, 100 Hz, at the origin of the sensor frame with its axes, as its metadata say (a real
OS1's is a centimetre beside). Gyroscope 5 mdps/sqrt(Hz), accelerometer 135 ug/sqrt(Hz). Constant biases and
their random walks are ours: of the order of the data sheets' zero-rate and zero-g levels.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sitl.sensors.lidar_mount import Mount
from sitl.sensors.sensor_clock import Clock
from sitl.vehicle.pose_track import Motion

F64 = NDArray[np.float64]
I64 = NDArray[np.int64]

GRAVITY_MS2 = 9.80665


@dataclass(frozen=True, slots=True)
class InertialErrors:
    """Error model, per axis.

    gyro_noise, accel_noise: white, rad/s and m/s2 per sqrt(Hz). gyro_bias_rad_s, accel_bias_ms2: standard
    deviations of the constant biases. gyro_walk, accel_walk: random walks of the biases, rad/s and m/s2 per
    sqrt(s).
    """

    gyro_noise: float
    accel_noise: float
    gyro_bias_rad_s: float
    accel_bias_ms2: float
    gyro_walk: float = 2e-5
    accel_walk: float = 2e-4

    @classmethod
    def none(cls) -> InertialErrors:
        """Return the model of an error-free unit."""
        return cls(0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


@dataclass(frozen=True, slots=True)
class InertialModel:
    """Rate, place in the sensor frame (m), and errors of a unit."""

    rate_hz: int
    place_m: tuple[float, float, float]
    errors: InertialErrors


ICM_40609 = InertialModel(
    200,
    (0.0110, 0.02329, -0.04412),
    InertialErrors(math.radians(0.0045), 100e-6 * GRAVITY_MS2, math.radians(0.3), 0.013 * GRAVITY_MS2),
)
IAM_20680 = InertialModel(
    100,
    (0.0, 0.0, 0.0),
    InertialErrors(math.radians(0.005), 135e-6 * GRAVITY_MS2, math.radians(0.3), 0.02 * GRAVITY_MS2),
)


@dataclass(frozen=True, slots=True)
class InertialSamples:
    """Samples in sensor axes: stamp_ns (n,) of the sensor's clock, rate_rad_s and force_ms2 (n, 3)."""

    stamp_ns: I64
    rate_rad_s: F64
    force_ms2: F64


class InertialUnit:
    """Unit in a LiDAR on a moving vehicle.

    Parameters
    ----------
    rng
        Source of all noise; the output does not depend on how time is divided.
    model
        Kind of unit.
    """

    def __init__(self, rng: np.random.Generator, model: InertialModel) -> None:
        self.model = model
        self._rng = rng
        e = model.errors
        sigma = np.repeat([e.gyro_bias_rad_s, e.accel_bias_ms2], 3)
        self._bias: F64 = sigma * rng.standard_normal(6)
        self._period_ns = 1_000_000_000 // model.rate_hz
        bandwidth = math.sqrt(model.rate_hz / 2)
        self._white = np.repeat([e.gyro_noise, e.accel_noise], 3) * bandwidth
        self._walk = np.repeat([e.gyro_walk, e.accel_walk], 3) * math.sqrt(1.0 / model.rate_hz)

    def measure(self, t0_ns: int, t1_ns: int, motion: Motion, mount: Mount, clock: Clock) -> InertialSamples:
        """Return the samples due after t0 up to t1, simulated time."""
        period = self._period_ns
        index = np.arange(clock.elapsed_ns(t0_ns) // period, clock.elapsed_ns(t1_ns) // period + 2)
        elapsed = index.astype(np.int64) * period
        times = clock.simulated_ns(elapsed)
        due = (times > t0_ns) & (times <= t1_ns)
        elapsed, times = elapsed[due], times[due]
        to_sensor = mount.rotation_frd_from_sensor()
        place_frd = np.array(mount.lever_frd_m) + to_sensor @ np.array(self.model.place_m)
        rate_frd, force_frd = motion.felt(times, place_frd, GRAVITY_MS2)
        true = np.hstack([rate_frd @ to_sensor, force_frd @ to_sensor])
        draws = self._rng.standard_normal((len(true), 12))
        biases = self._bias + np.cumsum(self._walk * draws[:, :6], axis=0)
        measured = true + biases + self._white * draws[:, 6:]
        self._bias = biases[-1] if len(biases) else self._bias
        return InertialSamples(clock.offset_ns + elapsed, measured[:, :3], measured[:, 3:])
