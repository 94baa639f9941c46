"""The frozen scenes: closed-form ground of 22 m with hazards of one kind or several, and their places.

Version and digests are in `benchmark_case`. A change of any number here is a new version.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from companion.desk.open_benchmark.hazard_shapes import (
    Cable,
    Crater,
    Disc,
    Dome,
    Ground,
    Hills,
    Mound,
    Shape,
    Slab,
    Stairs,
    Step,
)
from companion.desk.open_benchmark.landing_task import F64, CellGrid, LandingTask

HALF_M = 11.0  # half the side of a scene
JUDGED_M = 9.0  # half the side of the ground that is judged: hazards beyond it are seen, too
CELL_M = 0.2
DENSITIES = (10, 20, 100)
"""Pulses per m² of the whole flight."""
ORIGIN = (47.0, 8.0, 400.0)
"""Latitude, longitude (deg) and altitude (m) of every scene's local frame."""
WATER = "water"
CLUTTER, DUST = 0.005, 0.05
"""Share of returns that are dust or multipath: in clear air, in dust."""
SIDE = round(2 * HALF_M / CELL_M)
TASK = LandingTask(CellGrid(-HALF_M, -HALF_M, CELL_M, SIDE, SIDE))
OFF_LATTICE_M = 0.0004
"""Added to places in whole millimetres: no sample is then on the edge of a disc, where rounding decides."""
Rng = np.random.Generator


@dataclass(frozen=True, slots=True)
class FrozenScene:
    """Ground, shapes on it, wires over it; the seed of its returns, and the share of these that are none."""

    name: str
    seed: int
    ground: Ground
    shapes: tuple[Shape, ...] = ()
    cables: tuple[Cable, ...] = ()
    clutter: float = CLUTTER

    def height_m(self, x: F64, y: F64) -> F64:
        """Return the exact surface at points of any shape."""
        z = self.ground.height_m(x, y)
        for shape in self.shapes:
            z = z + shape.rise_m(x, y)
        return z

    @property
    def kinds(self) -> tuple[str, ...]:
        """Kinds of hazard in it; ground that is unsafe without any is of kind slope."""
        shapes, cables = (shape.kind for shape in self.shapes), (cable.kind for cable in self.cables)
        return tuple(dict.fromkeys((*shapes, *cables)))


def frozen_scenes() -> tuple[FrozenScene, ...]:
    """Return all frozen scenes, in the order of their seeds."""
    return tuple(_numbered())


def _numbered() -> Iterator[FrozenScene]:
    for seed, (name, build) in enumerate(_BUILDERS, start=1):
        parts = build(np.random.default_rng(5000 + seed))
        yield FrozenScene(name, seed, **parts)


def _places(rng: Rng, n: int, apart_m: float, reach_m: float = 8.5) -> list[tuple[float, float]]:
    """Return up to n random places at least a distance apart."""
    found: list[tuple[float, float]] = []
    for _ in range(5000):
        x, y = (round(float(v) + OFF_LATTICE_M, 4) for v in rng.uniform(-reach_m, reach_m, 2).round(3))
        if all((x - u) ** 2 + (y - v) ** 2 >= apart_m**2 for u, v in found):
            found.append((x, y))
        if len(found) == n:
            break
    return found


def _turn(rng: Rng) -> float:
    return round(float(rng.uniform(1.0, 179.0)), 3)


def _plane(slope_deg: float) -> Callable[[Rng], dict[str, Any]]:
    return lambda _rng: {"ground": Ground(slope_deg)}


def _discs(kind: str, n: int, diameter_m: float, height_m: float) -> Callable[[Rng], dict[str, Any]]:
    def build(rng: Rng) -> dict[str, Any]:
        at = _places(rng, n, 4.0)
        return {"ground": Ground(2.0), "shapes": tuple(Disc(kind, *p, diameter_m, height_m) for p in at)}

    return build


def _kerb(height_m: float) -> Callable[[Rng], dict[str, Any]]:
    return lambda rng: {"ground": Ground(1.0), "shapes": (Step("kerb", 0.013, 0.027, _turn(rng), height_m),)}


def _line(kind: str, length_m: float, width_m: float, height_m: float) -> Callable[[Rng], dict[str, Any]]:
    def build(rng: Rng) -> dict[str, Any]:
        shape = Slab(kind, 0.013, -0.031, _turn(rng), length_m, width_m, height_m)
        return {"ground": Ground(2.0), "shapes": (shape,)}

    return build


def _domes(rng: Rng, kind: str, n: int, least_m: float, most_m: float, flat: float) -> list[Shape]:
    """Return domes whose diameters follow a power law (cumulative exponent -2), as rocks do."""
    sizes = least_m / np.sqrt(1 - rng.random(n) * (1 - (least_m / most_m) ** 2))
    found: list[Shape] = []
    for size in (round(float(s), 3) for s in sizes):
        x, y = (round(float(v), 3) for v in rng.uniform(-9.5, 9.5, 2))
        width = round(size * float(rng.uniform(0.6, 1.0)), 3)
        found.append(Dome(kind, x, y, _turn(rng), size, width, round(size * flat, 3)))
    return found


def _rocks(n: int, least_m: float, most_m: float, slope_deg: float = 3.0) -> Callable[[Rng], dict[str, Any]]:
    return lambda rng: {
        "ground": Ground(slope_deg),
        "shapes": tuple(_domes(rng, "rock", n, least_m, most_m, 0.5)),
    }


def _bushes(rng: Rng) -> dict[str, Any]:
    shapes = tuple(Dome("vegetation", *p, _turn(rng), 2.2, 1.6, 1.2) for p in _places(rng, 6, 4.5))
    return {"ground": Ground(2.0), "shapes": shapes}


def _craters(n: int, least_m: float, most_m: float, apart_m: float) -> Callable[[Rng], dict[str, Any]]:
    def build(rng: Rng) -> dict[str, Any]:
        places = _places(rng, n, apart_m)
        sizes = np.linspace(least_m, most_m, len(places)).round(3)
        shapes = tuple(Crater("crater", *p, float(d)) for p, d in zip(places, sizes, strict=True))
        return {"ground": Ground(2.0), "shapes": shapes}

    return build


def _stairs(rng: Rng) -> dict[str, Any]:
    return {"ground": Ground(0.0), "shapes": (Stairs("stairs", 0.011, 0.017, _turn(rng), 0.28, 0.17, 12),)}


def _car(x: float, y: float, turn_deg: float) -> tuple[Shape, Shape]:
    return Slab("car", x, y, turn_deg, 4.2, 1.8, 0.8), Slab("car", x, y, turn_deg, 2.2, 1.6, 0.65)


def _cars(rng: Rng) -> dict[str, Any]:
    parked = [_car(*p, _turn(rng)) for p in _places(rng, 4, 6.0, 7.0)]
    return {"ground": Ground(2.0), "shapes": tuple(part for car in parked for part in car)}


def _wires(radius_m: float, height_m: float) -> Callable[[Rng], dict[str, Any]]:
    def build(_rng: Rng) -> dict[str, Any]:
        cables = tuple(
            Cable("wire", (-HALF_M, y, height_m), (HALF_M, y + 3.0, height_m), radius_m)
            for y in (-4.013, 2.029)
        )
        return {"ground": Ground(2.0), "cables": cables}

    return build


def _hills(height_m: float, length_m: float) -> Callable[[Rng], dict[str, Any]]:
    return lambda _rng: {"ground": Ground(1.0), "shapes": (Hills("hill", length_m, height_m),)}


def _mounds(height_m: float) -> Callable[[Rng], dict[str, Any]]:
    def build(rng: Rng) -> dict[str, Any]:
        shapes = tuple(Mound("bump", *p, 0.6, height_m) for p in _places(rng, 6, 5.0))
        return {"ground": Ground(2.0), "shapes": shapes}

    return build


def _pond(rng: Rng) -> dict[str, Any]:
    ((x, y),) = _places(rng, 1, 0.0, 3.0)
    return {"ground": Ground(0.0, texture_m=0.004), "shapes": (Disc(WATER, x, y, 9.0, -0.15),)}


def _building(rng: Rng) -> dict[str, Any]:
    shape = Slab("building", 1.507, -2.203, _turn(rng), 9.0, 7.0, 3.5)
    return {"ground": Ground(1.0), "shapes": (shape,)}


def _yard(rng: Rng) -> dict[str, Any]:
    """Return the objects about a house: one hazard of most kinds."""
    (x0, y0), (x1, y1), *spots = _places(rng, 6, 4.2, 8.0)
    shapes: list[Shape] = [*_car(x0, y0, _turn(rng)), Slab("wall", x1, y1, _turn(rng), 5.0, 0.12, 0.6)]
    shapes += [Disc("pole", *spots[0], 0.1, 2.0), Disc("hole", *spots[1], 0.5, -0.7)]
    shapes += [Step("kerb", 7.5, 0.013, 90.0 - _turn(rng) / 20, -0.35)]
    shapes += _domes(rng, "rock", 10, 0.3, 0.9, 0.6)
    cable = Cable("wire", (-HALF_M, 7.019, 5.0), (HALF_M, 8.027, 5.0), 0.015)
    return {"ground": Ground(2.0), "shapes": tuple(shapes), "cables": (cable,)}


def _moon(rng: Rng) -> dict[str, Any]:
    """Return rocks among craters on a slope, as planetary landers meet them."""
    bowls = zip(_places(rng, 3, 6.0), (2.2, 3.4, 5.0), strict=True)
    shapes: list[Shape] = [Crater("crater", *place, diameter_m) for place, diameter_m in bowls]
    return {"ground": Ground(4.0), "shapes": (*shapes, *_domes(rng, "rock", 30, 0.3, 1.6, 0.5))}


def _in_dust(build: Callable[[Rng], dict[str, Any]]) -> Callable[[Rng], dict[str, Any]]:
    return lambda rng: build(rng) | {"clutter": DUST}


_BUILDERS: tuple[tuple[str, Callable[[Rng], dict[str, Any]]], ...] = (
    ("plane-0deg", _plane(0.0)),
    ("plane-8deg", _plane(8.0)),
    ("plane-9.5deg", _plane(9.5)),
    ("plane-13deg", _plane(13.0)),
    ("kerb-0.1m", _kerb(0.1)),
    ("kerb-0.35m", _kerb(0.35)),
    ("kerb-0.5m", _kerb(0.5)),
    ("pole-0.1x1.5m", _discs("pole", 12, 0.1, 1.5)),
    ("pole-0.3x0.4m", _discs("pole", 12, 0.3, 0.4)),
    ("rock-0.2-0.6m", _rocks(60, 0.2, 0.6)),
    ("rock-0.4-2m", _rocks(25, 0.4, 2.0)),
    ("rock-field-dense", _rocks(150, 0.15, 1.2, 1.0)),
    ("crater-2-6m", _craters(5, 2.0, 6.0, 5.5)),
    ("crater-1.2-2m", _craters(8, 1.2, 2.0, 4.0)),
    ("stairs", _stairs),
    ("car", _cars),
    ("wall-0.5x0.1m", _line("wall", 13.0, 0.1, 0.5)),
    ("ditch-0.5x0.6m", _line("ditch", 40.0, 0.5, -0.6)),
    ("ditch-1x0.8m", _line("ditch", 40.0, 1.0, -0.8)),
    ("hole-0.5x0.6m", _discs("hole", 8, 0.5, -0.6)),
    ("hole-0.4x3m", _discs("hole", 8, 0.4, -3.0)),
    ("wire-30mm", _wires(0.015, 5.0)),
    ("hills-0.3x9m", _hills(0.3, 9.0)),
    ("bump-0.28m", _mounds(0.28)),
    ("bump-0.45m", _mounds(0.45)),
    ("vegetation", _bushes),
    ("building", _building),
    ("water", _pond),
    ("yard", _yard),
    ("moon", _moon),
    ("dust-plane", _in_dust(_plane(3.0))),
    ("dust-rocks", _in_dust(_rocks(25, 0.4, 2.0))),
)
