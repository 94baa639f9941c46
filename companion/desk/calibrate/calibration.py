"""Calibration run of `slz calibrate`: boresight and time offset from a recorded flight."""

from __future__ import annotations

import logging
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from companion.desk.calibrate.overlap_agreement import NAMES, Fit, TooLittleError, solve
from companion.desk.replay.recorded_sensors import RecordedSensors
from companion.desk.replay.recording_reader import RecordingReader
from companion.flight.fusion.motion import STRETCH
from companion.flight.fusion.placement import place
from companion.flight.fusion.pose_history import PoseHistory
from companion.flight.geometry.sensor_mount import FRD_FROM_FLU, Mount
from companion.flight.recorder.journal import BadRecordError
from companion.flight.sensors.returns import Returns, join
from companion.runtime.errors import CompanionError
from params import Parameters

Floats = NDArray[np.float64]
MOST_DELAY_MS = 100.0

log = logging.getLogger(__name__)

MOST_RETURNS = 600_000
MOST_POSES = 400_000  # two hours at 50 Hz
# Largest accepted standard error (degrees, ms): beyond it the flight does not determine the correction.
BELIEVED = np.array([0.1, 0.1, 0.1, 2.0])
ADVICE = "fly figures of eight over ground with slopes or houses, turning, at changing height and speed"


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


def run(path: Path, settings: Iterable[str]) -> dict[str, Any]:
    """Estimate the corrections and return the summary.

    Raises
    ------
    UsageError
        The file is no recording, or a setting is wrong.
    CompanionError
        The flight shows no ground twice, or determines none of the corrections.
    """
    recording = RecordingReader(path)
    parameters = recording.header.parameters(settings)
    flown = _read(path, recording, parameters)
    try:
        fit = solve(flown.place, flown.stamp_s, np.zeros(4, bool))
        unsure = fit.sigma > BELIEVED
        if unsure.any() and not unsure.all():
            fit = solve(flown.place, flown.stamp_s, unsure)
    except TooLittleError as error:
        raise CompanionError(f"{path}: {error}; {ADVICE}") from None
    if unsure.all():
        raise CompanionError(f"{path}: the flight does not show boresight or time offset; {ADVICE}")
    return _summary(path, fit, unsure, parameters)


def _summary(path: Path, fit: Fit, unsure: np.ndarray[Any, Any], parameters: Parameters) -> dict[str, Any]:
    angles = mount_angles(corrected(Mount(parameters).rotation_frd_from_sensor, fit.correction))
    new = {name: round(value, 3) for name, value in angles.items()}
    new["lidar_delay_ms"] = round(parameters.lidar_delay_ms + float(fit.correction[3]), 2)
    return {
        "file": str(path),
        "correction": {
            name: None if left_out else round(float(value), 4)
            for name, value, left_out in zip(NAMES, fit.correction, unsure, strict=True)
        },
        "standard_error": {
            name: None if left_out else round(float(value), 4)
            for name, value, left_out in zip(NAMES, fit.sigma, unsure, strict=True)
        },
        "not_shown": [name for name, left_out in zip(NAMES, unsure, strict=True) if left_out],
        "before_m": round(fit.before_m, 4),
        "after_m": round(fit.after_m, 4),
        "planes": fit.cubes,
        "returns": fit.returns,
        "parameters": new,
    }


def _read(path: Path, recording: RecordingReader, parameters: Parameters) -> FlownReturns:
    """Return the flight's returns, subsampled where there are many, and its poses."""
    sample = SystematicSample(MOST_RETURNS)
    sensors = RecordedSensors(recording.header, parameters, sample.add_batch, MOST_POSES)
    bad = 0
    for message in recording.messages():
        try:
            sensors.on_message(message)
        except BadRecordError:
            bad += 1
    if bad:
        log.warning("%d messages cannot be read and are left out", bad)
    if not sample.parts or sensors.history.frame is None:
        raise CompanionError(f"{path}: it holds no returns or no positions")
    flown = FlownReturns(join(sample.parts), sensors.history, parameters)
    if not len(flown):
        raise CompanionError(f"{path}: it holds no return that is in range and has a pose")
    return flown


class SystematicSample:
    """Systematic sample of a flight's returns, since an hour of them would not fit into memory.

    parts: the kept returns in order, at most `most`.
    """

    def __init__(self, most: int) -> None:
        self.parts: list[Returns] = []
        self._most = most
        self._every, self._skip, self._count = 1, 0, 0

    def add_batch(self, returns: Returns) -> None:
        """Add a batch; when there are too many, keep every second return of all."""
        part = returns.select(slice(self._skip, None, self._every))
        self._skip = (self._skip - len(returns)) % self._every
        self.parts.append(part)
        self._count += len(part)
        while self._count > self._most:
            self._every *= 2
            self.parts = [join(self.parts).select(slice(None, None, 2))]
            self._count = len(self.parts[0])


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
