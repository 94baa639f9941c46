"""Kinds of ground against the truth: tables by scene, and the reliability of the probability of water."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

import numpy as np

from companion.desk.reproduce import reliability
from companion.desk.reproduce.reproduction_page import Pictures, Section, Table
from companion.desk.reproduce.surface_surveys import (
    OBJECT,
    ClassifiedSurface,
    Kinds,
    SurfaceSurvey,
    run,
)
from slz import SurfaceKind

if TYPE_CHECKING:
    from matplotlib.axes import Axes

KINDS = (SurfaceKind.BARE, SurfaceKind.WATER, SurfaceKind.ROOF, SurfaceKind.LOW_VEGETATION)
TEXT = (
    "Surveys at 20 m over the highest thing below, by 100,000 pulses/s, placed with the true pose; cells of "
    "1 m by their true kind. Shares are of those that have a kind at the end; refused: the probability of "
    "water is above water_suspicion, so that nothing there is safe. Roof: error of its height over the "
    "ground around it, where it is classified as one."
)
COLUMNS = (
    "scene",
    "truth",
    "cells",
    "classified",
    "rightly, %",
    "as water, %",
    "refused, %",
    "roof, median error, m",
    "roof, worst error, m",
)
WATER_TEXT = (
    "Cells of 0.2 m of the near map that are truly water: those seen, and those of them called safe at the "
    "end of the survey, and after the window when these were most."
)
WATER_COLUMNS = ("scene", "water cells seen", "safe at the end", "%", "safe at worst", "%")
PROBABILITY_TEXT = (
    "The cells of 1 m above, and those of canopy and of things on the ground, by their probability of water. "
    "Expected calibration error, the mean difference over all cells: "
)
PROBABILITY_COLUMNS = (
    "probability of water",
    "cells",
    "mean probability",
    "share truly water",
    "classified as water",
    "of those no water",
)
WORDS = reliability.Words("Probability of water against the truth", *PROBABILITY_COLUMNS[2:])

MAYBE_WATER = OBJECT + 1
# Colours of Paul Tol's scheme "muted", which colour-blind readers can distinguish.
COLOURS = {
    int(SurfaceKind.UNKNOWN): "#ffffff",
    int(SurfaceKind.BARE): "#ddcc77",
    int(SurfaceKind.WATER): "#332288",
    int(SurfaceKind.ROOF): "#cc6677",
    int(SurfaceKind.LOW_VEGETATION): "#44aa99",
    int(SurfaceKind.CANOPY): "#117733",
    OBJECT: "#777777",
    MAYBE_WATER: "#88ccee",
}
NAMES = {
    **{int(kind): kind.word for kind in SurfaceKind},
    OBJECT: "things on the ground",
    MAYBE_WATER: "may be water: refused",
}
SAFE_WATER = "#ff3b00"


@dataclass(frozen=True, slots=True)
class KindCount:
    """Cells of one true kind.

    known: those classified. right: as this kind. water: as water. refused: probability of water above the
    limit. roof_errors_m: median and worst error of the heights of roofs, NaN if none is classified as one.
    """

    cells: int
    known: int
    right: int
    water: int
    refused: int
    roof_errors_m: tuple[float, float]

    @classmethod
    def of(cls, found: ClassifiedSurface, kind: SurfaceKind) -> Self:
        """Count the cells of a survey whose true kind is this one."""
        everywhere = found.truth == kind
        own = found.known & everywhere
        right = own & (found.kind == kind)
        errors = np.abs(found.raised_m - found.roof_height_m)[right & np.isfinite(found.roof_height_m)]
        return cls(
            int(everywhere.sum()),
            int(own.sum()),
            int(right.sum()),
            int((own & (found.kind == SurfaceKind.WATER)).sum()),
            int((own & found.refused).sum()),
            (float(np.median(errors)), float(errors.max())) if len(errors) else (np.nan, np.nan),
        )

    def row(self, scene: str, kind: SurfaceKind) -> tuple[str, ...]:
        """Return the row of the table."""
        shares = (_percent(n, self.known) for n in (self.right, self.water, self.refused))
        errors = ("" if np.isnan(error) else f"{error:.2f}" for error in self.roof_errors_m)
        return scene, kind.word, f"{self.cells:,}", f"{self.known:,}", *shares, *errors

    def figures(self) -> dict[str, Any]:
        """Return the counts for JSON."""
        errors = [round(error, 3) for error in self.roof_errors_m if not np.isnan(error)]
        roof = {"roof_error_m": errors} if errors else {}
        return {
            "cells": self.cells,
            "known": self.known,
            "right": self.right,
            "called_water": self.water,
            "refused": self.refused,
        } | roof


def section(
    surveys: Sequence[SurfaceSurvey], out: Path, folder: Path, progress: Callable[[str], None]
) -> Section:
    """Fly every survey, count the kinds of ground by scene and truth, and draw them beside the truth.

    Parameters
    ----------
    surveys
        At least one.
    folder
        Folder of the recordings.
    """
    rows: list[tuple[str, ...]] = []
    water_rows: list[tuple[str, ...]] = []
    pictures: list[Pictures] = []
    figures: dict[str, Any] = {}
    probabilities: dict[str, reliability.Bins] = {}
    out.mkdir(parents=True, exist_ok=True)
    for survey in surveys:
        progress(survey.name)
        found = run(survey, folder)
        counts = {kind: KindCount.of(found, kind) for kind in KINDS}
        rows += [count.row(survey.scene, kind) for kind, count in counts.items() if count.cells]
        if counts[SurfaceKind.WATER].cells:
            water_rows.append(_water_row(survey.scene, found))
        probabilities[survey.scene] = _probabilities(found)
        file = out / f"surface_of_{survey.scene}.png"
        draw(survey, found, file)
        pictures.append((f"{survey.name}: truth, and as classified", [file]))
        figures[survey.scene] = {
            "kinds": {kind.word: count.figures() for kind, count in counts.items() if count.cells},
            "water_seen_and_safe_at_end": list(found.at_end),
            "water_seen_and_safe_at_worst": list(found.at_worst),
        }
    diagram = out / "probability_of_water.png"
    reliability.draw(probabilities, WORDS, diagram)
    total = reliability.add(probabilities)
    tables = [
        Table("Kinds of ground", TEXT, COLUMNS, rows),
        Table("Water called safe", WATER_TEXT, WATER_COLUMNS, water_rows),
        Table(
            "Probability of water",
            PROBABILITY_TEXT + f"{total.error:.4f}.",
            PROBABILITY_COLUMNS,
            reliability.rows(total),
        ),
    ]
    pictures.append((WORDS.title, [diagram]))
    return Section(
        tables,
        pictures,
        {"surface": figures, "probability_of_water": reliability.figures(probabilities)},
    )


def _water_row(scene: str, found: ClassifiedSurface) -> tuple[str, ...]:
    (seen, at_end), (seen_then, at_worst) = found.at_end, found.at_worst
    shares = _percent(at_end, seen), _percent(at_worst, seen_then)
    return scene, f"{seen:,}", f"{at_end:,}", shares[0], f"{at_worst:,}", shares[1]


def _percent(part: int, whole: int) -> str:
    return f"{100 * part / whole:.1f}" if whole else ""


def _probabilities(found: ClassifiedSurface) -> reliability.Bins:
    """Count the known cells by their probability of water."""
    use = found.known & (found.truth != SurfaceKind.UNKNOWN)
    truly = found.truth[use] == SurfaceKind.WATER
    return reliability.Bins.of(found.water[use], truly, found.kind[use] == SurfaceKind.WATER)


def draw(survey: SurfaceSurvey, result: ClassifiedSurface, file: Path) -> None:
    """Draw the truth on the left, and on the right the kinds found, with the water called safe."""
    from matplotlib.figure import Figure
    from matplotlib.patches import Patch

    x0, y0, x1, y1 = survey.extent_m
    figure = Figure(figsize=(11.0, 1.2 + 5.0 * (y1 - y0) / (x1 - x0)), dpi=130, layout="constrained")
    true, found = figure.subplots(1, 2, sharey=True)
    shown = np.where(result.refused & (result.kind != SurfaceKind.WATER), np.uint8(MAYBE_WATER), result.kind)
    _draw_kinds(true, survey, result.truth, "Truth")
    _draw_kinds(found, survey, shown, "Classified after the survey")
    true.set_ylabel("north, m", fontsize=9)
    present = np.union1d(result.truth, shown).tolist()
    handles = [
        Patch(facecolor=COLOURS[kind], edgecolor="#555555", linewidth=0.6, label=NAMES[kind])
        for kind in COLOURS
        if kind in present
    ]
    if result.safe_water.any():
        _draw_safe_water(found, survey, result)
        handles.append(Patch(facecolor=SAFE_WATER, label="water called safe at the end"))
    figure.suptitle(survey.name.capitalize(), fontsize=13, fontweight="bold", x=0.02, ha="left")
    figure.legend(handles=handles, loc="outside lower center", ncols=len(handles), fontsize=9, frameon=False)
    figure.savefig(file, bbox_inches="tight", pad_inches=0.15)


def _draw_kinds(axes: Axes, survey: SurfaceSurvey, kinds: Kinds, title: str) -> None:
    from matplotlib.colors import ListedColormap

    x0, y0, x1, y1 = survey.extent_m
    colours = ListedColormap([COLOURS[kind] for kind in range(len(COLOURS))])
    axes.imshow(
        kinds,
        origin="lower",
        extent=(x0, x1, y0, y1),
        cmap=colours,
        vmin=-0.5,
        vmax=len(COLOURS) - 0.5,
        interpolation="nearest",
    )
    axes.set_title(title, loc="left", fontsize=11)
    axes.set_xlabel("east, m", fontsize=9)
    axes.tick_params(labelsize=8)


def _draw_safe_water(axes: Axes, survey: SurfaceSurvey, result: ClassifiedSurface) -> None:
    from matplotlib.colors import to_rgba

    x0, y0, x1, y1 = survey.extent_m
    layer = np.zeros((*result.safe_water.shape, 4))
    layer[result.safe_water] = to_rgba(SAFE_WATER)
    axes.imshow(layer, origin="lower", extent=(x0, x1, y0, y1), interpolation="nearest")
