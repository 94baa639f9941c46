"""Plan view of a failed flight: truly safe ground, path, beginning of the fault, touchdown."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path

import matplotlib as mpl
import numpy as np

mpl.use("Agg")
from matplotlib import pyplot as plt
from matplotlib.axes import Axes
from matplotlib.colors import ListedColormap

from companion.flight.landing.situation import Phase
from sitl import scenes
from sitl.truth import truth
from tests.campaign.log import Flown

AROUND_M, CELL_M = 8.0, 0.25
GROUND = ListedColormap(["#d9a4a0", "#cfe3c8"])
COLOURS = dict(zip((phase.value for phase in Phase), plt.get_cmap("tab10").colors, strict=False))


def draw(flight: Flown, wrong: list[str], path: Path) -> None:
    """Draw plan and height over time into a PNG file."""
    figure, (plan, side) = plt.subplots(1, 2, figsize=(12, 6), width_ratios=[1.2, 1], layout="constrained")
    _ground(plan, flight)
    _way(plan, side, flight)
    _marks(plan, side, flight)
    figure.suptitle(
        f"{flight['number']}: {flight['fault']} in {flight['state']}, {flight['scene']}\n{'; '.join(wrong)}",
        fontsize=11,
    )
    figure.savefig(path, dpi=90)
    plt.close(figure)


def _ground(plan: Axes, flight: Flown) -> None:
    world = scenes.build(flight["scene"], flight["number"]).world
    places = np.array([row[1:3] for row in flight["path"]])
    west, south, east, north = world.extent_m
    x0, y0 = np.maximum(places.min(axis=0) - AROUND_M, (west + 2, south + 2))
    x1, y1 = np.minimum(places.max(axis=0) + AROUND_M, (east - 2, north - 2))
    found = truth.safe_map(world, (float(x0), float(y0), float(x1), float(y1)), CELL_M)
    rows, columns = found.safe.shape
    extent = (x0, x0 + columns * CELL_M, y0, y0 + rows * CELL_M)
    plan.imshow(found.safe, origin="lower", extent=extent, cmap=GROUND, vmin=0, vmax=1)
    plan.set(xlabel="east, m", ylabel="north, m", aspect="equal", title="green: truly safe (before any car)")


def _way(plan: Axes, side: Axes, flight: Flown) -> None:
    rows = flight["path"]
    shown: set[str] = set()
    for before, after in pairwise(rows):
        phase = before[7]
        style = {"color": COLOURS[phase], "lw": 1.8, "label": None if phase in shown else phase}
        shown.add(phase)
        plan.plot([before[1], after[1]], [before[2], after[2]], **style)
        side.plot([before[0], after[0]], [before[3], after[3]], **style)
    side.set(xlabel="time, s", ylabel="height over ground, m", title=f"mode at the end: {flight['mode']}")
    side.grid(alpha=0.3)


def _marks(plan: Axes, side: Axes, flight: Flown) -> None:
    if flight["began_s"] is not None:
        side.axvspan(flight["began_s"], flight["ended_s"], color="orange", alpha=0.25, label="fault")
        at = next(row for row in flight["path"] if row[0] >= flight["began_s"] - 0.3)
        plan.plot(at[1], at[2], "*", ms=14, color="orange", mec="black", label="fault begins")
    if flight["chosen"] is not None:
        plan.plot(
            flight["chosen"][0], flight["chosen"][1], "+", ms=14, mew=2.5, color="black", label="point chosen"
        )
    end = flight["touchdown"] or flight["collision"]
    if end is not None:
        name = "touchdown" if flight["touchdown"] else "collision"
        plan.plot(end["e"], end["n"], "X", ms=11, color="red", mec="black", label=name)
    plan.legend(loc="best", fontsize=8)
    side.legend(loc="best", fontsize=8)
