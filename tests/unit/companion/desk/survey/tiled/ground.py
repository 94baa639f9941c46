"""Survey of 220 m x 170 m, larger than any tile: fields, a ditch, boxes, a wire and strays."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from companion.desk.survey.tiled.derive_tiles import KEPT
from companion.desk.survey.tiled.task_engine import Engine, InProcess
from companion.desk.survey.tiled.tile_store import Store
from companion.desk.survey.tiled.tiled_survey import Surveyed, TiledSurvey
from params import Parameters, load
from tests.unit.companion.desk.survey.clouds import write

CORNER = np.array([500_020.0, 4_500_030.0, 0.0])  # blocks of 128 m end inside
SIDES_M = (220.0, 170.0)


def points(n: int = 150_000, seed: int = 3) -> NDArray[np.float64]:
    """Return (n, 3) coordinates in UTM, on whole millimetres."""
    rng = np.random.default_rng(seed)
    xyz = rng.uniform(0, 1, (n, 3)) * (*SIDES_M, 0)
    x, y = xyz[:, 0], xyz[:, 1]
    xyz[:, 2] = 50 + 0.02 * x + np.sin(y / 40) + rng.normal(0, 0.01, n)
    xyz[np.abs(x - 130 - 20 * np.sin(y / 30)) < 1.5, 2] -= 1.0  # a ditch from south to north, nearly
    xyz[(np.abs(x - 130) < 25) & (np.abs(y - 100) < 4), 2] = 53.0  # a bridge over it
    for east, north in rng.uniform(10, 160, (8, 2)):
        xyz[(np.abs(x - east) < 2) & (np.abs(y - north) < 3), 2] += 2.5
    wire = np.arange(0.0, 170, 2.0)
    over = np.column_stack([60 + wire / 4, wire, np.full(len(wire), 75.0)])
    over = np.repeat(over, 3, axis=0) + rng.normal(0, 0.1, (3 * len(wire), 3))
    birds = np.column_stack([rng.uniform(5, 165, (6, 2)), np.full(6, 140.0)])
    return np.round(np.concatenate([xyz, over, birds]) + CORNER, 3)


def files(folder: Path, xyz: NDArray[np.float64], order: NDArray[np.int64], count: int) -> list[Path]:
    """Write points, in an order, to so many files."""
    return [
        write(folder / f"{k}.laz", part) for k, part in enumerate(np.array_split(xyz[order], count), start=1)
    ]


def parameters(*settings: str) -> Parameters:
    return load("quadcopter", ["cell_m=0.5", *settings])


def surveyed(
    paths: Sequence[Path],
    work: Path,
    tile_m: float | None = None,
    engine: Engine | None = None,
    *settings: str,
) -> Surveyed:
    work.mkdir(parents=True, exist_ok=True)
    run = TiledSurvey(
        paths, work, parameters(*settings), engine or InProcess(), lambda *_: None, tile_m=tile_m
    )
    return run.run()


def answer(found: Surveyed) -> tuple[Any, ...]:
    """Return all that a survey found, to the last bit."""
    store = Store(found.layout)
    everything = found.layout.grid.everything
    maps = tuple(
        store.read(name, everything).tobytes() for name in (*(layer.name for layer in KEPT), "state")
    )
    zones = tuple(
        (
            one.zone.id,
            one.first,
            one.zone.area_m2,
            one.zone.certainty,
            one.zone.slope_deg,
            one.zone.n_safe,
            one.zone.n_unsafe,
            one.zone.n_uncertain,
            one.zone.best.enu_m.tobytes(),
            one.zone.cells.tobytes(),
            one.zone.boundary_cells.tobytes(),
            one.square_centre_m,
            one.n_obstacles,
            one.polygon_m.wkb,
        )
        for one in found.found
    )
    counts = (found.n_read, found.n_used, found.dropped, found.n_safe, found.n_unsafe)
    return (maps, zones, found.layout.whole, found.density_per_m2, found.parameters.coverage_m, counts)


class Counted:
    """Carries tasks out, counts those of each name, and fails before one of them as a killed process does."""

    def __init__(self, most: int = 10**9) -> None:
        self.done: list[str] = []
        self._most = most

    def each(self, task: Callable[..., Any], items: Sequence[Any], *shared: Any) -> Iterator[tuple[Any, Any]]:
        for item in items:
            if len(self.done) == self._most:
                raise KeyboardInterrupt
            self.done.append(task.__name__)
            yield item, task(item, *shared)
