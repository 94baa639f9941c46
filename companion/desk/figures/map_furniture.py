"""Map furniture: title, axes, scale bar, and the marks of a flight."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from companion.desk.figures.picture import Picture

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Floats = NDArray[np.float64]
PATH, CHOSEN, TAKE_OFF, TOUCHDOWN = "#2166ac", "#ffd92f", "#ffffff", "#e7298a"


@dataclass(frozen=True, slots=True)
class Marks:
    """Marks drawn over a map: points (3,) and a path (n, 3) in the map frame."""

    path_enu_m: Floats | None = None
    take_off_enu_m: Floats | None = None
    chosen_enu_m: Floats | None = None
    touchdown_enu_m: Floats | None = None


NO_MARKS = Marks()


def draw_marks(axes: Axes, marks: Marks) -> None:
    if marks.path_enu_m is not None:
        path = marks.path_enu_m
        axes.plot(path[:, 0], path[:, 1], color="white", linewidth=3.2, alpha=0.8, zorder=4)
        axes.plot(path[:, 0], path[:, 1], color=PATH, linewidth=1.6, label="flown path", zorder=5)
    for point, marker, size, colour, label in (
        (marks.take_off_enu_m, "^", 80, TAKE_OFF, "take-off"),
        (marks.chosen_enu_m, "*", 420, CHOSEN, "chosen point"),
        (marks.touchdown_enu_m, "X", 45, TOUCHDOWN, "touchdown"),
    ):
        if point is not None:
            axes.scatter(
                [point[0]],
                [point[1]],
                s=size,
                c=colour,
                marker=marker,
                edgecolors="black",
                linewidths=1.0,
                label=label,
                zorder=7,
            )


def draw_frame(axes: Axes, picture: Picture, title: str) -> None:
    west, east, south, north = picture.bounds
    axes.set_xlim(west, east)
    axes.set_ylim(south, north)
    axes.set_aspect("equal")
    axes.set_title(title, loc="left", fontsize=13, fontweight="bold")
    axes.set_xlabel("east, m", fontsize=9)
    axes.set_ylabel("north, m", fontsize=9)
    axes.tick_params(labelsize=8)
    _scale_bar(axes, picture)
    if axes.get_legend_handles_labels()[0]:
        axes.legend(
            loc="lower right",
            bbox_to_anchor=(1.0, 1.0),
            ncols=4,
            fontsize=8,
            frameon=False,
            markerscale=0.7,
            columnspacing=1.4,
        )


def _scale_bar(axes: Axes, picture: Picture) -> None:
    """Draw a bar of a round length, at most a sixth of the width, in the lower left corner."""
    width = picture.extent_m[0]
    power = 10.0 ** math.floor(math.log10(width / 6))
    length = max(f * power for f in (1, 2, 5) if f * power <= width / 6)
    transform = axes.transAxes
    left, bottom = 0.02, 0.03
    end = left + length / width
    axes.plot([left, end], [bottom, bottom], color="white", linewidth=5, transform=transform, zorder=8)
    axes.plot([left, end], [bottom, bottom], color="black", linewidth=2.5, transform=transform, zorder=8)
    axes.text(
        (left + end) / 2,
        bottom + 0.012,
        f"{length:g} m",
        transform=transform,
        ha="center",
        va="bottom",
        fontsize=8,
        zorder=8,
        bbox={"facecolor": "white", "edgecolor": "none", "alpha": 0.7, "pad": 1.0},
    )
