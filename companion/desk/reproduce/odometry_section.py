"""LiDAR odometry under drift: table of errors, consistency and time, and a plot of each survey."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2

from companion.desk.reproduce.reproduction_page import Section, Table
from companion.desk.reproduce.source_scenes import CASES
from companion.desk.reproduce.survey_recording import FRAME, SurveyRecording, fly
from companion.flight.fusion.odometry.gyro_track import GyroTrack
from companion.flight.fusion.odometry.lidar_odometry import LidarOdometry
from companion.flight.fusion.pose_history import PoseHistory
from companion.flight.geometry.sensor_mount import Mount
from params import Parameters

TITLE = "LiDAR odometry"
TEXT = (
    "Surveys at 20 m over the highest thing below, 5 m/s, 200,000 pulses/s, placed with a pose that drifts "
    "(none, moderate and severe of dynablox, Schmid et al., RA-L 2023). Errors of autopilot and odometry are "
    "relative to the map, which begins at the first scan; observed: share of updates in which scan and map "
    "tell both horizontal axes, and height. Within 95 %: share of updates whose normalised square of the "
    "error along the axes observed (NEES) is below the bound of chi2. Times depend on the machine and on "
    "what else it does."
)
COLUMNS = (
    "survey",
    "way, m",
    "autopilot, horizontal rms, m",
    "odometry, horizontal rms, m",
    "at the end, % of the way",
    "autopilot, up rms, m",
    "odometry, up rms, m",
    "place observed, %",
    "height observed, %",
    "within 95 %, %",
    "update, median / p95 ms",
)

Floats = NDArray[np.float64]

# Standard deviation of the drift's velocity along each horizontal axis and vertically, m/s, held for 10 s:
# severities of dynablox (Schmid et al., RA-L 2023), along east and north here.
SEVERITIES = {"no": (0.0, 0.0), "moderate": (0.0075, 0.0025), "severe": (0.03, 0.01)}
HOLD_S = 10.0
POSE_STEP_S = 0.025
SEED = 1
BAND = 0.95


@dataclass(frozen=True, slots=True)
class DriftingSurvey:
    """A survey of the sources' scenes, flown by an autopilot of a severity of drift."""

    scene: str
    severity: str

    @property
    def name(self) -> str:
        return f"odometry over {self.scene}, {self.severity} drift"


SURVEYS = (
    *(DriftingSurvey("stadium", severity) for severity in SEVERITIES),
    *(DriftingSurvey(scene, "severe") for scene in ("dense", "streets", "mountains", "plain")),
)


@dataclass(frozen=True, slots=True)
class DriftOutcome:
    """Errors relative to the map, which begins where the autopilot believed to be.

    at_s: (n,) since the first update. drift_enu_m, error_enu_m: (n, 3) of the autopilot's position, and of
    the odometry's. observed: (n, 3) bool, axes that scan and map determine. squares: (n,) normalised square
    of the error along the axes observed, by the covariance stated. way_m: flown. ms: (n,) of an update.
    """

    survey: DriftingSurvey
    at_s: Floats
    drift_enu_m: Floats
    error_enu_m: Floats
    observed: NDArray[np.bool_]
    squares: Floats
    way_m: float
    ms: Floats
    refused: int

    @property
    def inside_band(self) -> float:
        """Return the share of updates whose square is below the 95 % bound of chi2; NaN if none observes."""
        axes = self.observed.sum(axis=1)
        some = axes > 0
        return float((self.squares[some] <= chi2.ppf(BAND, axes[some])).mean()) if some.any() else np.nan


class _Track:
    """True track of the sensor, and the track that a drifting autopilot believes."""

    def __init__(self, recording: SurveyRecording, severity: str) -> None:
        counts = recording.count > 0
        last = np.cumsum(recording.count)[counts] - 1
        self._at_s = recording.stamp_ns[last] * 1e-9
        self._true = recording.sensor_enu_m[counts]
        self.way_m = float(np.linalg.norm(np.diff(self._true, axis=0), axis=1).sum())
        horizontal_ms, up_ms = SEVERITIES[severity]
        holds = np.arange(self._at_s[0], self._at_s[-1] + 2 * HOLD_S, HOLD_S)
        drawn = np.random.default_rng(SEED).standard_normal((len(holds) - 1, 3))
        drawn *= (horizontal_ms, horizontal_ms, up_ms)
        self._holds = holds
        self._off = np.concatenate([np.zeros((1, 3)), np.cumsum(drawn * HOLD_S, axis=0)])

    def true_enu_m(self, at_s: float) -> Floats:
        """Return the true position (3,)."""
        return np.array([np.interp(at_s, self._at_s, axis) for axis in self._true.T])

    def off_enu_m(self, at_s: float) -> Floats:
        """Return the error of the autopilot's position (3,)."""
        return np.array([np.interp(at_s, self._holds, axis) for axis in self._off.T])

    def _believed_enu_m(self, at_s: float) -> Floats:
        return self.true_enu_m(at_s) + self.off_enu_m(at_s)

    def add_pose(self, history: PoseHistory, at_s: float) -> None:
        """Add the autopilot's pose of a moment; its attitude is right."""
        at_ns = round(at_s * 1e9)
        before, here, after = (self._believed_enu_m(at_s + step) for step in (-POSE_STEP_S, 0.0, POSE_STEP_S))
        east, north, up = (after - before) / (2 * POSE_STEP_S)
        lat, lon, alt = (float(v) for v in FRAME.lla(here))
        history.add_attitude(at_ns, (1.0, 0.0, 0.0, 0.0), (0.0, 0.0, 0.0))
        history.add_position(at_ns, lat, lon, alt, (float(north), float(east), -float(up)))


def section(
    surveys: Sequence[DriftingSurvey], out: Path, recordings: Path, progress: Callable[[str], None]
) -> Section:
    """Run the surveys, plot their errors, and tabulate them."""
    outcomes = []
    for survey in surveys:
        progress(survey.name)
        outcomes.append(run(survey, recordings))
    file = out / "odometry.png"
    _draw(outcomes, file)
    rows = [_row(outcome) for outcome in outcomes]
    figures = {outcome.survey.name: _figures(outcome) for outcome in outcomes}
    return Section([Table(TITLE, TEXT, COLUMNS, rows)], [(TITLE, [file])], {"odometry": figures})


def _figures(outcome: DriftOutcome) -> dict[str, float]:
    """Return the figures of a survey, for JSON."""
    place = outcome.observed[:, :2].all(axis=1)
    return {
        "way_m": round(outcome.way_m, 1),
        "autopilot_rms_m": _rms(outcome.drift_enu_m[:, :2]),
        "odometry_rms_m": _rms(outcome.error_enu_m[:, :2]),
        "end_of_way": round(float(np.linalg.norm(outcome.error_enu_m[-1, :2])) / outcome.way_m, 6),
        "autopilot_up_rms_m": _rms(outcome.drift_enu_m[:, 2:]),
        "odometry_up_rms_m": _rms(outcome.error_enu_m[:, 2:]),
        "place_observed": round(float(place.mean()), 3),
        "height_observed": round(float(outcome.observed[:, 2].mean()), 3),
        "inside_band": round(outcome.inside_band, 3),
        "ms_median": round(float(np.median(outcome.ms)), 1),
        "ms_p95": round(float(np.percentile(outcome.ms, 95)), 1),
        "refused": outcome.refused,
    }


def _row(outcome: DriftOutcome) -> tuple[str, ...]:
    figures = _figures(outcome)
    return (
        f"{outcome.survey.scene}, {outcome.survey.severity} drift",
        f"{figures['way_m']:.0f}",
        f"{figures['autopilot_rms_m']:.2f}",
        f"{figures['odometry_rms_m']:.2f}",
        f"{100 * figures['end_of_way']:.3f}",
        f"{figures['autopilot_up_rms_m']:.2f}",
        f"{figures['odometry_up_rms_m']:.2f}",
        f"{100 * figures['place_observed']:.0f}",
        f"{100 * figures['height_observed']:.0f}",
        f"{100 * figures['inside_band']:.0f}",
        f"{figures['ms_median']:.1f} / {figures['ms_p95']:.1f}",
    )


def _rms(vectors_m: np.ndarray[tuple[int, ...], np.dtype[np.float64]]) -> float:
    """Return the root of the mean square length of vectors (n, k)."""
    return round(float(np.sqrt((vectors_m**2).sum(axis=1).mean())), 4)


def _draw(outcomes: Sequence[DriftOutcome], file: Path) -> None:
    from matplotlib.figure import Figure

    file.parent.mkdir(parents=True, exist_ok=True)
    rows = -(-len(outcomes) // 2)
    figure = Figure(figsize=(11.0, 2.6 * rows + 0.6), dpi=120, layout="constrained")
    for number, outcome in enumerate(outcomes):
        axes = figure.add_subplot(rows, min(2, len(outcomes)), number + 1)
        for name, errors, colour in (
            ("autopilot", outcome.drift_enu_m, "tab:gray"),
            ("odometry", outcome.error_enu_m, "tab:blue"),
        ):
            label = name if number == 0 else None
            axes.plot(outcome.at_s, np.linalg.norm(errors[:, :2], axis=1), color=colour, label=label)
            axes.plot(outcome.at_s, errors[:, 2], color=colour, linestyle="--", linewidth=0.9)
        axes.set_title(f"{outcome.survey.scene}, {outcome.survey.severity} drift", loc="left", fontsize=10)
        axes.set_xlabel("s", fontsize=8)
        axes.set_ylabel("error, m (dashed: up)", fontsize=8)
        axes.grid(alpha=0.3, linewidth=0.5)
        axes.tick_params(labelsize=8)
    figure.legend(loc="outside lower center", ncols=2, fontsize=8, frameon=False)
    figure.savefig(file, bbox_inches="tight", pad_inches=0.15)


def run(survey: DriftingSurvey, folder: Path) -> DriftOutcome:
    """Fly a survey, or load its recording from the folder, and follow it with the odometry."""
    recording = fly(next(case.survey for case in CASES if case.survey.scene == survey.scene), folder)
    track, history = _Track(recording, survey.severity), PoseHistory(Parameters(), FRAME)
    odometry = LidarOdometry(history, GyroTrack(Mount(Parameters())))
    at_s, drift, errors, observed, squares, ms = [], [], [], [], [], []
    pose_s: float | None = None
    for scan in recording.scans():
        if not len(scan):
            continue
        newest_s = float(scan.stamp_ns[-1]) * 1e-9
        pose_s = newest_s if pose_s is None else pose_s
        while pose_s <= newest_s + POSE_STEP_S:
            track.add_pose(history, pose_s)
            pose_s += POSE_STEP_S
        off, updates = track.off_enu_m(newest_s), odometry.updates
        believed = replace(
            scan, points_enu_m=scan.points_enu_m + off, sensor_enu_m=scan.sensor_enu_m + off, attributes=None
        )
        started = time.perf_counter()
        odometry.add(believed)
        spent_ms = 1e3 * (time.perf_counter() - started)
        estimate = odometry.estimate
        if odometry.updates == updates or estimate is None:
            continue
        error = estimate.position_enu_m - track.true_enu_m(estimate.stamp_ns * 1e-9)
        axes = estimate.observed[:3]
        part = estimate.pose_covariance[:3, :3][np.ix_(axes, axes)]
        at_s.append(newest_s)
        drift.append(off)
        errors.append(error)
        observed.append(axes)
        squares.append(float(error[axes] @ np.linalg.solve(part, error[axes])) if axes.any() else 0.0)
        ms.append(spent_ms)
    return DriftOutcome(
        survey,
        np.array(at_s) - at_s[0],
        np.array(drift),
        np.array(errors),
        np.array(observed),
        np.array(squares),
        track.way_m,
        np.array(ms),
        odometry.refused,
    )
