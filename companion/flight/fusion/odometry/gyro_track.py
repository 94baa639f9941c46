"""Rotation of the vehicle by the gyroscope in its LiDAR, and the error of the LiDAR's mount seen by it."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Sequence
from functools import reduce

import numpy as np
from numpy.typing import NDArray

from companion.flight.geometry.sensor_mount import Mount
from companion.flight.sensors.imu_samples import ImuSamples
from companion.runtime.ring_buffer import RingBuffer, SampleBuffer

Floats = NDArray[np.float64]

CAPACITY = 8192  # samples: 41 s at 200 Hz, 13 s at 640 Hz
GAP_NS = 50_000_000
SILENT_NS = 5_000_000_000  # the sensor was off, and its bias may be another one
HALF_NS = 10_000_000  # a rate of the autopilot is compared with the mean of 20 ms
FRESH_S = 0.2
LEAST_S, MEMORY_S = 5.0, 30.0
STEADY_RADS = 0.5  # bias is compared below, so that delays and errors of scale matter less
MOST_BIAS_RADS = 0.1  # of a sound unit, ten times over
TURN_RADS = 0.1
MOST_TURNS = 2000  # 40 s at 50 Hz
LEAST_TURNING = 0.2  # rad2/s about the second axis: 3 s with an amplitude of 0.36 rad/s
MOST_WAITING = 100


class GyroTrack:
    """Buffer of the LiDAR's rates in body axes, with their bias by the autopilot's.

    Both rates must be on the companion's clock. A rate of the autopilot waits until the samples around it
    have arrived.

    Parameters
    ----------
    mount
        Boresight of the LiDAR.
    capacity
        Number of samples kept.
    """

    def __init__(self, mount: Mount, capacity: int = CAPACITY) -> None:
        self._rotation = mount.rotation_frd_from_sensor
        self._samples = SampleBuffer(3, capacity)
        self._turns = RingBuffer(MOST_TURNS, (7,))  # autopilot's rate, sample's rate, s
        self._waiting: deque[tuple[int, Floats]] = deque(maxlen=MOST_WAITING)
        self._bias_rads = np.zeros(3)
        self._compared_s = 0.0
        self._compared_ns: int | None = None

    def add_samples(self, samples: ImuSamples) -> None:
        """Append the LiDAR's samples; those older than the newest are dropped.

        After a silence of 5 s, or if the stamps go back by as much, everything begins anew.
        """
        rates = samples.rate_rads @ self._rotation.T
        for stamp_ns, rate in zip(samples.stamp_ns.tolist(), rates, strict=True):
            newest_ns = self._samples.newest_ns
            if newest_ns is not None and abs(stamp_ns - newest_ns) > SILENT_NS:
                self.clear()
            elif newest_ns is not None and stamp_ns <= newest_ns:
                continue
            self._samples.append(stamp_ns, rate)
        self._compare()

    def add_attitude(self, stamp_ns: int, quat_wxyz: Sequence[float], rates: Sequence[float]) -> None:
        """Append body rates of the autopilot, rad/s; the attitude itself is not used."""
        if self._waiting and stamp_ns <= self._waiting[-1][0]:
            return
        rate = np.array(rates, dtype=np.float64)
        if np.isfinite(rate).all():
            self._waiting.append((stamp_ns, rate))
            self._compare()

    @property
    def bias_rads(self) -> Floats | None:
        """Bias (3,) in body axes, rad/s.

        None before 5 s of comparison, and if it is greater than that of a sound unit.
        """
        if self._compared_s < LEAST_S or np.linalg.norm(self._bias_rads) > MOST_BIAS_RADS:
            return None
        return self._bias_rads.copy()

    def rotation_between(self, t0_ns: int, t1_ns: int) -> Floats | None:
        """Return the rotation (3, 3) of body axes (forward, right, down) at `t1_ns` into those at `t0_ns`.

        The attitude at `t1_ns` is that at `t0_ns` times the result. Between samples the rate is linear. None
        if a sample is missing at either end, across a gap of more than 50 ms, and without a bias.
        """
        if t1_ns < t0_ns:
            back = self.rotation_between(t1_ns, t0_ns)
            return None if back is None else np.ascontiguousarray(back.T)
        bias, nodes = self.bias_rads, self._nodes(t0_ns, t1_ns)
        if bias is None or nodes is None:
            return None
        times_s, rates = nodes[0], nodes[1] - bias
        step_s, before, after = np.diff(times_s)[:, None], rates[:-1], rates[1:]
        # Magnus expansion to fourth order for a rate that is linear in each step.
        turns = step_s / 2 * (before + after) + step_s**2 / 12 * np.cross(before, after)
        return reduce(np.matmul, _rotations(turns), np.eye(3))

    def mount_error_deg(self) -> float | None:
        """Return the angle between the autopilot's turns and those of the LiDAR, both in body axes, degrees.

        It is the error of the mount's angles, from the changes of the last turns (Kabsch), so that biases do
        not matter. None until the vehicle has turned enough about two axes.
        """
        if not len(self._turns):
            return None
        rows = self._turns.array()
        seconds = rows[:, 6:]
        changes = rows[:, :6] - (seconds * rows[:, :6]).sum(axis=0) / seconds.sum()
        theirs, ours = changes[:, :3], changes[:, 3:]
        if np.linalg.eigvalsh(theirs.T @ (seconds * theirs))[1] < LEAST_TURNING:
            return None
        return math.degrees(_angle_rad(_kabsch(theirs, seconds * ours)))

    def clear(self) -> None:
        """Forget samples, bias and turns."""
        self._samples.clear()
        self._turns.clear()
        self._waiting.clear()
        self._compared_s, self._compared_ns = 0.0, None

    # ---- parts ----------------------------------------------------------------------------------

    def _compare(self) -> None:
        """Compare the waiting rates of the autopilot with the samples around them."""
        newest_ns = self._samples.newest_ns
        while newest_ns is not None and self._waiting and self._waiting[0][0] + HALF_NS <= newest_ns:
            stamp_ns, theirs = self._waiting.popleft()
            nodes = self._nodes(stamp_ns - HALF_NS, stamp_ns + HALF_NS)
            if nodes is None:
                continue
            times_s, rates = nodes
            ours = np.trapezoid(rates, times_s, axis=0) / times_s[-1]
            since_ns, self._compared_ns = self._compared_ns, stamp_ns
            seconds = math.inf if since_ns is None else (stamp_ns - since_ns) * 1e-9
            if 0 < seconds <= FRESH_S:
                self._learn(theirs, ours, seconds)

    def _learn(self, theirs: Floats, ours: Floats, seconds: float) -> None:
        speed = float(np.linalg.norm(theirs))
        if speed >= TURN_RADS:
            self._turns.append(np.array([*theirs, *ours, seconds]))
        if speed <= STEADY_RADS:
            self._compared_s += seconds
            share = seconds / min(self._compared_s, MEMORY_S)
            self._bias_rads = (1 - share) * self._bias_rads + share * (ours - theirs)

    def _nodes(self, t0_ns: int, t1_ns: int) -> tuple[Floats, Floats] | None:
        """Return times since `t0_ns` (n,), s, and body rates (n, 3): both ends and the samples between."""
        stamp_ns, rates = self._samples.stamp_ns, self._samples.values
        first = int(np.searchsorted(stamp_ns, t0_ns, side="right")) - 1
        last = int(np.searchsorted(stamp_ns, t1_ns, side="left"))
        if first < 0 or last >= len(stamp_ns) or (np.diff(stamp_ns[first : last + 1]) > GAP_NS).any():
            return None
        known_s = (stamp_ns[first : last + 1] - t0_ns) * 1e-9
        inside = known_s[(known_s > 0) & (known_s < (t1_ns - t0_ns) * 1e-9)]
        times_s = np.concatenate([[0.0], inside, [(t1_ns - t0_ns) * 1e-9]])
        columns = [np.interp(times_s, known_s, rates[first : last + 1, axis]) for axis in range(3)]
        return times_s, np.stack(columns, axis=-1)


def _rotations(vectors: Floats) -> Floats:
    """Return the rotations (n, 3, 3) about vectors (n, 3) by their lengths, rad (Rodrigues' formula)."""
    squares = (vectors**2).sum(axis=1)
    angles = np.sqrt(squares)
    sines = np.sinc(angles / np.pi)[:, None, None]
    versines = (np.sinc(angles / (2 * np.pi)) ** 2 / 2)[:, None, None]
    cross = np.zeros((len(vectors), 3, 3))
    x, y, z = vectors.T
    cross[:, 2, 1], cross[:, 0, 2], cross[:, 1, 0] = x, y, z
    cross -= cross.transpose(0, 2, 1)
    return np.asarray(np.eye(3) + sines * cross + versines * (cross @ cross))


def _kabsch(target: Floats, source: Floats) -> Floats:
    """Return the rotation (3, 3) that turns vectors `source` (n, 3) best into `target` (n, 3)."""
    left, _, right = np.linalg.svd(target.T @ source)
    return np.asarray(left @ np.diag([1.0, 1.0, np.linalg.det(left @ right)]) @ right)


def _angle_rad(rotation: Floats) -> float:
    axis = rotation[[2, 0, 1], [1, 2, 0]] - rotation[[1, 2, 0], [2, 0, 1]]
    return math.atan2(float(np.linalg.norm(axis)), float(np.trace(rotation)) - 1)
