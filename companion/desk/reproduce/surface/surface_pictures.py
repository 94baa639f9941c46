"""Pictures of true and classified kinds of ground, side by side."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from companion.desk.reproduce.surface.surface_surveys import OBJECT, ClassifiedSurface, Kinds, SurfaceSurvey
from slz import SurfaceKind

if TYPE_CHECKING:
    from matplotlib.axes import Axes

MAYBE_WATER = OBJECT + 1
# Colours of Paul Tol's scheme "muted", which colour-blind readers can tell apart.
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
