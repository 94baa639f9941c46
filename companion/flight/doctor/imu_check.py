"""Check of the LiDAR's own inertial measurement unit, and of the mount by the direction of gravity."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from companion.flight.doctor.finding import Finding, State
from companion.flight.geometry.axes import rotation_enu_from_frd
from companion.flight.geometry.sensor_mount import Mount
from companion.flight.sensors.imu_samples import ImuSamples

Floats = NDArray[np.float64]

CHECK = "LiDAR IMU"
LEAST_HZ = 90.0
MOST_BIAS_DEGS = 3.0
GRAVITY_MS2, GRAVITY_SHARE = 9.81, 0.03
MOUNT_DEG, WRONG_MOUNT_DEG = 3.0, 10.0
REST_RADS = 0.05  # greatest standard deviation at rest, and greatest mean rate of the autopilot
LEAST_S = 1.0
NEEDED = (
    f"at least {LEAST_HZ:g} Hz; at rest a bias of at most {MOST_BIAS_DEGS:g} deg/s,"
    f" {GRAVITY_MS2} m/s2 within {100 * GRAVITY_SHARE:g} %, the mount within {MOUNT_DEG:g} deg"
)
UNDATED = "give points and IMU of the sensor one clock (its time stamp mode), and see that its points arrive"
FEW = "see that nothing else sends to the port of the IMU, and use a wired network of its own"
FORCE = (
    "its accelerometer, or the units of its firmware, are wrong: update the firmware; odometry works without"
)
BIAS = "its gyroscope is bad: let it warm up and repeat; odometry works without"
MOUNT = (
    "set lidar_roll_deg and lidar_pitch_deg to how the LiDAR is mounted; where they are right, calibrate the"
    " autopilot's level"
)


class ImuObservation:
    """Inertial samples and attitudes that arrive while the doctor listens.

    Parameters
    ----------
    mount
        Boresight of the LiDAR as configured.
    """

    def __init__(self, mount: Mount) -> None:
        self._rotation = mount.rotation_frd_from_sensor
        self._samples: list[ImuSamples] = []
        self._up_frd: list[Floats] = []
        self._rates: list[float] = []

    def add_samples(self, samples: ImuSamples) -> None:
        """Store samples of the LiDAR."""
        self._samples.append(samples)

    def add_attitude(self, stamp_ns: int, quat_wxyz: Sequence[float], rates: Sequence[float]) -> None:
        """Store the autopilot's attitude and body rates."""
        self._up_frd.append(rotation_enu_from_frd(quat_wxyz)[2])
        self._rates.append(math.hypot(*rates))

    def findings(self, statistics: Mapping[str, int | float | None]) -> list[Finding]:
        """Judge them; without any inertial packet there is no finding."""
        packets = int(statistics.get("imu") or 0)
        if not self._samples:
            said = f"{packets} packets, none with a time"
            return [Finding(CHECK, "warn", said, NEEDED, UNDATED)] if packets else []
        stamp_ns = np.concatenate([samples.stamp_ns for samples in self._samples])
        span_s = (stamp_ns.max() - stamp_ns.min()) * 1e-9
        if span_s < LEAST_S:
            return [Finding(CHECK, "warn", f"{len(stamp_ns)} samples in {span_s:.1f} s", NEEDED, FEW)]
        rate_hz = (len(stamp_ns) - 1) / span_s
        faults: list[tuple[State, str]] = []
        if rate_hz < LEAST_HZ:
            faults.append(("warn", FEW))
        said = f"{rate_hz:.0f} Hz, {self._judge_rest(faults)}"
        state: State = "ok"
        for bad in ("warn", "fail"):
            if any(fault == bad for fault, _ in faults):
                state = bad
        remedy = "; ".join(text for _, text in sorted(faults))
        return [Finding(CHECK, state, said, NEEDED, remedy)]

    def _judge_rest(self, faults: list[tuple[State, str]]) -> str:
        """Return what was measured at rest, and append what is wrong with it."""
        rates = np.concatenate([samples.rate_rads for samples in self._samples])
        noise = float(rates.std(axis=0).max())
        if noise > REST_RADS or (self._rates and np.mean(self._rates) > REST_RADS):
            return "not at rest: the rest is not judged"
        bias_degs = math.degrees(float(np.linalg.norm(rates.mean(axis=0))))
        force = np.concatenate([samples.specific_force_ms2 for samples in self._samples]).mean(axis=0)
        weight_ms2 = float(np.linalg.norm(force))
        said = f"bias {bias_degs:.2f} deg/s, noise {math.degrees(noise):.2f} deg/s, {weight_ms2:.2f} m/s2"
        if bias_degs > MOST_BIAS_DEGS:
            faults.append(("warn", BIAS))
        if abs(weight_ms2 / GRAVITY_MS2 - 1) > GRAVITY_SHARE:
            faults.append(("warn", FORCE))
            return said
        if not self._up_frd:
            return f"{said}, no attitude to compare the mount with"
        error_deg = _angle_deg(self._rotation @ force, np.mean(self._up_frd, axis=0))
        if error_deg > MOUNT_DEG:
            faults.append(("fail" if error_deg > WRONG_MOUNT_DEG else "warn", MOUNT))
        return f"{said}, mount {error_deg:.1f} deg from the autopilot's vertical"


def _angle_deg(a: Floats, b: Floats) -> float:
    return math.degrees(math.atan2(float(np.linalg.norm(np.cross(a, b))), float(a @ b)))
