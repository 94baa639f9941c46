"""Georeferencing of a recorded flight's returns with a trial boresight and time offset."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from companion.flight.fusion.motion import STRETCH
from companion.flight.fusion.placement import place
from companion.flight.fusion.pose_history import PoseHistory
from companion.flight.geometry.sensor_mount import FRD_FROM_FLU, Mount
from companion.flight.sensors.returns import Returns
from params import Parameters

Floats = NDArray[np.float64]
MOST_DELAY_MS = 100.0


class FlownReturns:
    """Returns of a flight with all its poses.

    Parameters
    ----------
    parameters
        Range gate, and the mount that corrections are relative to.
    """

    def __init__(self, returns: Returns, history: PoseHistory, parameters: Parameters) -> None:
        self._samples = history.samples()
        self._mount = Mount(parameters)
        kept = self._in_range(returns, parameters)
        kept &= self._have_poses(returns.stamp_ns, round(MOST_DELAY_MS * 1e6))
        self._xyz_sensor_m = np.ascontiguousarray(returns.xyz_sensor_m[kept])
        self._stamp_ns = np.ascontiguousarray(returns.stamp_ns[kept])

    def __len__(self) -> int:
        return len(self._stamp_ns)

    @property
    def stamp_s(self) -> Floats:
        """Stamps of the returns (n,) since the first."""
        return np.asarray((self._stamp_ns - self._stamp_ns.min()) * 1e-9)

    def place(self, correction: Floats) -> Floats:
        """Return the georeferenced returns (n, 3).

        correction: rotations of the sensor about the body's forward, left and up axes (degrees), and the
        delay of the stamps after the measurement (ms), at most `MOST_DELAY_MS` either way.
        """
        n = len(self)
        delay_ms = float(np.clip(correction[3], -MOST_DELAY_MS, MOST_DELAY_MS))
        points, written = np.empty((n, 3)), np.empty(n, np.int64)
        count, _, _ = place(
            self._xyz_sensor_m,
            self._stamp_ns - round(delay_ms * 1e6),
            *self._samples,
            corrected(self._mount.rotation_frd_from_sensor, correction),
            self._mount.lever_frd_m,
            0.0,
            1e6,
            points,
            written,
            np.empty(n, np.int64),
        )
        assert count == n  # noqa: S101 - every return has poses at any delay
        return points

    @staticmethod
    def _in_range(returns: Returns, p: Parameters) -> NDArray[np.bool_]:
        distance = np.linalg.norm(returns.xyz_sensor_m, axis=1)
        return np.asarray((distance >= p.lidar_min_m) & (distance <= p.lidar_max_m))

    def _have_poses(self, stamps: NDArray[np.int64], margin_ns: int) -> NDArray[np.bool_]:
        """Return the mask of stamps around which, within the margin, poses are dense and continuous."""
        attitude_ns, _, position_ns, positions, gap_ns = self._samples
        steady = np.zeros(max(len(attitude_ns) - 1, 0), bool)
        jumps = positions[1:, STRETCH] != positions[:-1, STRETCH]
        kept = np.ones(len(stamps), bool)
        for track, broken in ((attitude_ns, steady), (position_ns, jumps)):
            first = np.searchsorted(track, stamps - margin_ns, side="left") - 1
            after = np.searchsorted(track, stamps + margin_ns, side="right")
            kept &= (first >= 0) & (after < len(track))
            n_broken = np.concatenate([[0], np.cumsum(broken | (np.diff(track) > gap_ns))])
            last = len(n_broken) - 1
            kept &= n_broken[np.clip(first, 0, last)] == n_broken[np.clip(after, 0, last)]
        return kept


def corrected(rotation_frd_from_sensor: Floats, correction: Floats) -> Floats:
    """Return the boresight rotated by small angles about the body's forward, left and up axes (degrees)."""
    turn = Rotation.from_rotvec(np.radians(correction[:3])).as_matrix()
    return np.ascontiguousarray(FRD_FROM_FLU @ turn @ FRD_FROM_FLU @ rotation_frd_from_sensor)


def mount_angles(rotation_frd_from_sensor: Floats) -> dict[str, float]:
    """Return the mount parameters of a boresight, see `companion.flight.geometry.sensor_mount`."""
    yaw, pitch, roll = Rotation.from_matrix(FRD_FROM_FLU @ rotation_frd_from_sensor).as_euler(
        "ZYX", degrees=True
    )
    return {"lidar_roll_deg": float(roll), "lidar_pitch_deg": float(pitch), "lidar_yaw_deg": float(yaw)}
