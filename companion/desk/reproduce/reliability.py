"""Reliability diagram of a probability: share of cells for which it is true, by probability."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

import numpy as np
from numpy.typing import NDArray

from companion.desk.reproduce.reproduction_page import Section, Table
from companion.desk.reproduce.survey_recording import SurveyRecording
from companion.desk.reproduce.truth_comparison import truth_at
from slz import SAFE, UNKNOWN, TerrainMaps

if TYPE_CHECKING:
    from matplotlib.axes import Axes

EDGES = (0.0, 0.01, 0.05, *(round(0.1 * i, 1) for i in range(1, 10)), 0.95, 0.99, 0.999, 1.0)
FEWEST = 50  # cells of a bin below which its share is not significant
TEXT = (
    "All known cells of 0.2 m of the surveys above that lie 3 m or more within the surveyed extent, by their "
    "certainty: its mean, and the share of them that is truly safe, which are alike where it is calibrated. "
    "Called safe: cells that the map lets a vehicle land on, and how many of those are truly unsafe. "
    "Expected calibration error, the mean difference over all cells: "
)
COLUMNS = ("certainty", "cells", "mean certainty", "share truly safe", "called safe", "of those unsafe")


@dataclass(frozen=True, slots=True)
class Words:
    """Title and labels of a diagram: its axes, and the bars of cells called so and of those wrongly so."""

    title: str
    mean: str
    share: str
    called: str
    wrong: str


CERTAINTY = Words("Certainty against the truth", *COLUMNS[2:])


@dataclass(frozen=True, slots=True)
class Bins:
    """Counts by bin of `EDGES`: cells, sum of their probabilities, truly so, called so, wrongly so."""

    cells: NDArray[np.int64]
    total: NDArray[np.float64]
    true: NDArray[np.int64]
    called: NDArray[np.int64]
    wrong: NDArray[np.int64]

    @classmethod
    def of(cls, probability: NDArray[Any], true: NDArray[np.bool_], called: NDArray[np.bool_]) -> Self:
        """Count cells, given (n,) each; a bin includes its lower bound, the last one both."""
        n = len(EDGES) - 1
        # Bounds in float32, so that a probability of 0.99 equals the bound of 0.99.
        number = np.searchsorted(np.array(EDGES, np.float32), probability.astype(np.float32), "right") - 1
        number = number.clip(0, n - 1)

        def count(where: NDArray[np.bool_]) -> NDArray[np.int64]:
            return np.bincount(number[where], minlength=n).astype(np.int64)

        return cls(
            count(np.ones(len(number), bool)),
            np.asarray(np.bincount(number, probability.astype(np.float64), n), np.float64),
            count(true),
            count(called),
            count(called & ~true),
        )

    def __add__(self, other: Bins) -> Bins:
        return Bins(
            self.cells + other.cells,
            self.total + other.total,
            self.true + other.true,
            self.called + other.called,
            self.wrong + other.wrong,
        )

    @property
    def mean(self) -> NDArray[np.float64]:
        """Return the mean probability of each bin, NaN where empty."""
        with np.errstate(invalid="ignore"):
            return np.asarray(self.total / self.cells)

    @property
    def share(self) -> NDArray[np.float64]:
        """Return the share of cells of each bin for which it is true, NaN where empty."""
        with np.errstate(invalid="ignore"):
            return np.asarray(self.true / self.cells)

    @property
    def error(self) -> float:
        """Return the expected calibration error."""
        if not self.cells.sum():
            return float("nan")
        return float(np.abs(self.total - self.true).sum() / self.cells.sum())


def count(recording: SurveyRecording, maps: TerrainMaps) -> Bins:
    """Count the known cells of a map within the surveyed extent less its margin."""
    safe, inside = truth_at(recording, maps.grid, maps.box)
    use = inside & (maps.state != UNKNOWN)
    return Bins.of(maps.certainty[use], safe[use], maps.state[use] == SAFE)


def section(counted: Mapping[str, Bins], out: Path) -> Section:
    """Return the calibration error over all surveys, with a diagram of each survey and of all.

    Parameters
    ----------
    counted
        Bins by name of the survey, at least one.
    """
    total = add(counted)
    errors = [(name, bins.error) for name, bins in counted.items()]
    text = TEXT + f"{total.error:.4f}; by survey " + ", ".join(f"{name} {e:.4f}" for name, e in errors) + "."
    file = out / "certainty.png"
    draw(counted, CERTAINTY, file)
    table = Table("Certainty", text, COLUMNS, rows(total))
    return Section([table], [(CERTAINTY.title, [file])], {"certainty": figures(counted)})


def add(counted: Mapping[str, Bins]) -> Bins:
    """Return the sum of at least one survey's bins."""
    surveys = list(counted.values())
    return sum(surveys[1:], surveys[0])


def rows(total: Bins) -> list[tuple[str, ...]]:
    """Return a table's row for each bin: its bounds, cells, mean, share, cells called so, of those wrong."""
    return [
        (
            _bin_name(number),
            f"{total.cells[number]:,}",
            f"{total.mean[number]:.4f}" if total.cells[number] else "",
            f"{total.share[number]:.4f}" if total.cells[number] else "",
            f"{total.called[number]:,}",
            f"{total.wrong[number]:,}",
        )
        for number in range(len(EDGES) - 1)
    ]


def figures(counted: Mapping[str, Bins]) -> dict[str, Any]:
    """Return the calibration errors, and the cells, mean and share of each bin, for JSON."""
    total = add(counted)
    return {
        "calibration_error": round(total.error, 5),
        "by_survey": {name: round(bins.error, 5) for name, bins in counted.items()},
        "bins": {
            _bin_name(number): [
                int(total.cells[number]),
                round(float(total.mean[number]), 5),
                round(float(total.share[number]), 5),
            ]
            for number in range(len(EDGES) - 1)
            if total.cells[number]
        },
    }


def _bin_name(number: int) -> str:
    return f"{EDGES[number]:g} to {EDGES[number + 1]:g}"


def draw(counted: Mapping[str, Bins], words: Words, file: Path) -> None:
    """Draw the diagram of each survey and of all, and the cells of each bin below it, as PNG."""
    from matplotlib.figure import Figure

    total = add(counted)
    figure = Figure(figsize=(11.0, 8.0), dpi=130, layout="constrained")
    axes = figure.subplot_mosaic([["linear", "logit"], ["cells", "cells"]], height_ratios=(3, 1))
    _draw_diagram(axes["linear"], counted, total, words)
    axes["linear"].set_title(words.title, loc="left", fontsize=13, fontweight="bold")
    axes["linear"].legend(loc="lower right", fontsize=8, frameon=False)
    _draw_diagram(axes["logit"], counted, total, words)
    axes["logit"].set_title("the same, its ends drawn wide", loc="left", fontsize=11)
    axes["logit"].set_xscale("logit")
    axes["logit"].set_yscale("logit")
    axes["logit"].set_xlim(1e-4, 1 - 1e-4)
    axes["logit"].set_ylim(1e-4, 1 - 1e-4)
    _draw_cells(axes["cells"], total, words)
    figure.savefig(file, bbox_inches="tight", pad_inches=0.15)


def _draw_diagram(axes: Axes, counted: Mapping[str, Bins], total: Bins, words: Words) -> None:
    from matplotlib import colormaps

    line = np.concatenate([np.geomspace(1e-4, 0.5), 1 - np.geomspace(0.5, 1e-4)])
    axes.plot(line, line, color="#777777", linestyle="--", linewidth=1.2, label="calibrated")
    for number, (name, bins) in enumerate(counted.items()):
        colour = colormaps["tab10"](number % 10)
        x, y = _drawn(bins)
        axes.plot(x, y, color=colour, linewidth=0.8, marker=".", markersize=5, alpha=0.7, label=name)
    x, y = _drawn(total)
    axes.plot(x, y, color="black", linewidth=2.0, marker="o", markersize=5, label="all surveys")
    axes.set_xlabel(words.mean, fontsize=9)
    axes.set_ylabel(words.share, fontsize=9)
    axes.tick_params(labelsize=8)
    axes.grid(alpha=0.3, linewidth=0.5)


def _drawn(bins: Bins) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return mean and share, NaN for bins of few cells, clipped to the range of the logit axes."""
    many = bins.cells >= FEWEST
    x, y = (np.where(many, v, np.nan).clip(1.5e-4, 1 - 1.5e-4) for v in (bins.mean, bins.share))
    return x, y


def _draw_cells(axes: Axes, total: Bins, words: Words) -> None:
    n = len(EDGES) - 1
    places = np.arange(n)
    axes.bar(places, np.maximum(total.cells, 1), color="#9ecae1", edgecolor="#3182bd", label="known cells")
    axes.bar(places, np.maximum(total.called, 1), width=0.5, color="#1b7837", label=words.called)
    axes.bar(places, np.maximum(total.wrong, 1), width=0.2, color="#d7301f", label=words.wrong)
    axes.set_yscale("log")
    axes.set_ylim(1, 3.0 * max(1, int(total.cells.max())))
    axes.set_xticks(places, [_bin_name(number).replace(" to ", "–") for number in range(n)])
    axes.set_ylabel("cells", fontsize=9)
    axes.tick_params(labelsize=8)
    axes.legend(loc="upper center", ncols=3, fontsize=8, frameon=False)
