"""LiDAR odometry under drift: table of errors, consistency and time, and a plot of each survey."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from companion.desk.reproduce.odometry.drifting_survey import DriftingSurvey, DriftOutcome, run
from companion.desk.reproduce.reproduction_page import Section, Table

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
    told = _figures(outcome)
    return (
        f"{outcome.survey.scene}, {outcome.survey.severity} drift",
        f"{told['way_m']:.0f}",
        f"{told['autopilot_rms_m']:.2f}",
        f"{told['odometry_rms_m']:.2f}",
        f"{100 * told['end_of_way']:.3f}",
        f"{told['autopilot_up_rms_m']:.2f}",
        f"{told['odometry_up_rms_m']:.2f}",
        f"{100 * told['place_observed']:.0f}",
        f"{100 * told['height_observed']:.0f}",
        f"{100 * told['inside_band']:.0f}",
        f"{told['ms_median']:.1f} / {told['ms_p95']:.1f}",
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
