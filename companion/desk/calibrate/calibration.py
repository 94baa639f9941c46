"""Calibration run of `slz calibrate`: boresight and time offset from a recorded flight."""

from __future__ import annotations

import logging
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np

from companion.desk.calibrate.calibration_flight import FlownReturns, corrected, mount_angles
from companion.desk.calibrate.overlap_agreement import NAMES, Fit, TooLittleError, solve
from companion.desk.replay.recorded_sensors import RecordedSensors
from companion.desk.replay.recording_reader import RecordingReader
from companion.flight.geometry.sensor_mount import Mount
from companion.flight.recorder.journal import BadRecordError
from companion.flight.sensors.returns import Returns, join
from companion.runtime.errors import CompanionError
from params import Parameters

log = logging.getLogger(__name__)

MOST_RETURNS = 600_000
MOST_POSES = 400_000  # two hours at 50 Hz
# Largest accepted standard error (degrees, ms): beyond it the flight does not determine the correction.
BELIEVED = np.array([0.1, 0.1, 0.1, 2.0])
ADVICE = "fly figures of eight over ground with slopes or houses, turning, at changing height and speed"


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
