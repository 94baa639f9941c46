"""Rest poses of the landing gear on the exact surface, by brute force.

It shares no code and no method with the companion: every three pads are tried on the exact heights.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import combinations
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sitl.truth.truth_surface import sample_top
from sitl.world.world import World

F64 = NDArray[np.float64]

BELLY_PITCH_M = 0.02
_STEPS = 6  # samples along the radius of a pad
_WITHIN = 1e-9  # rounding of places and heights


@dataclass(frozen=True, slots=True)
class Gear:
    """Pads under the centre of gravity, (forward, right) of it, and a round belly above their plane, metres.

    The belly reaches as far out as the farthest pad. A skid is a row of pads.
    """

    pads_m: tuple[tuple[float, float], ...]
    pad_radius_m: float = 0.03
    clearance_m: float = 0.3

    @property
    def belly_radius_m(self) -> float:
        return max(math.hypot(*pad) for pad in self.pads_m)


class Stance(NamedTuple):
    """One pose in which the vehicle rests."""

    tilt_deg: float
    belly_touches: bool


KINDS = ("pads", "skids", "tripod")
SKID_PITCH_M = 0.1


def gear_of(
    kind: str = "pads",
    length_m: float = 0.57,
    width_m: float = 0.57,
    pad_radius_m: float = 0.03,
    clearance_m: float = 0.3,
) -> Gear:
    """Return a gear of a kind: four pads, two skids, or one pad before two.

    Raises
    ------
    ValueError
        If there is no such kind.
    """
    ahead, aside = length_m / 2, width_m / 2
    if kind == "pads":
        pads = [(ahead, -aside), (ahead, aside), (-ahead, -aside), (-ahead, aside)]
    elif kind == "skids":
        count = max(2, math.ceil(length_m / SKID_PITCH_M) + 1)
        pads = [(float(x), y) for y in (-aside, aside) for x in np.linspace(-ahead, ahead, count)]
    elif kind == "tripod":
        pads = [(ahead, 0.0), (-ahead, -aside), (-ahead, aside)]
    else:
        raise ValueError(f"gear {kind!r} is unknown; choose one of {', '.join(KINDS)}")
    return Gear(tuple(pads), pad_radius_m, clearance_m)


QUADCOPTER = gear_of()


def stances(world: World, gear: Gear, east_m: float, north_m: float, heading_rad: float) -> list[Stance]:
    """Return the poses in which a gear can rest; more than one where it rocks, none beyond the world.

    The pads stand on the surface below them, each on the highest under its disc. They come down level: the
    little by which a tilt draws them together is not counted.

    Parameters
    ----------
    world
        Movers count at their current places.
    east_m, north_m
        Place of the centre of gravity.
    heading_rad
        Clockwise from north.
    """
    sine, cosine = math.sin(heading_rad), math.cos(heading_rad)
    pads = np.array([(x * sine + y * cosine, x * cosine - y * sine) for x, y in gear.pads_m])
    steps = np.arange(-_STEPS, _STEPS + 1, dtype=np.float64) * (gear.pad_radius_m / _STEPS)
    heights = np.array(
        [_disc(world, (east_m + e, north_m + n), steps, gear.pad_radius_m)[2].max() for e, n in pads]
    )
    if np.isnan(heights).any():
        return []
    count = math.ceil(gear.belly_radius_m / BELLY_PITCH_M)
    lattice = np.arange(-count, count + 1, dtype=np.float64) * BELLY_PITCH_M
    under = _disc(world, (east_m, north_m), lattice, gear.belly_radius_m)
    return [
        Stance(math.degrees(math.atan(math.hypot(*plane[:2]))), _touches(plane, under, gear.clearance_m))
        for plane in _planes(pads, heights)
    ]


def _disc(world: World, centre: tuple[float, float], steps: F64, radius_m: float) -> tuple[F64, F64, F64]:
    """Return east and north of the centre, and height, of the samples within a disc."""
    pitch = float(steps[1] - steps[0])
    z, _ = sample_top(world, centre[0] + steps, centre[1] + steps, pitch)
    east, north = np.meshgrid(steps, steps)
    inside = np.hypot(east, north) <= radius_m + _WITHIN
    return east[inside], north[inside], z[inside]


def _planes(pads: F64, heights: F64) -> Iterator[tuple[float, float, float]]:
    """Yield east and north gradient and height at the centre of each plane on which the pads can rest."""
    for three in combinations(range(len(pads)), 3):
        corners = np.column_stack([pads[list(three)], np.ones(3)])
        if abs(np.linalg.det(corners)) < _WITHIN:
            continue  # in one line
        # Weights of the three pads: none is negative where the centre of gravity is between them.
        weights = np.linalg.solve(corners.T, [0.0, 0.0, 1.0])
        plane = np.linalg.solve(corners, heights[list(three)])
        ground_above_pads = heights - np.column_stack([pads, np.ones(len(pads))]) @ plane
        if weights.min() >= -_WITHIN and ground_above_pads.max() <= _WITHIN:
            yield float(plane[0]), float(plane[1]), float(plane[2])


def _touches(plane: tuple[float, float, float], under: tuple[F64, F64, F64], clearance_m: float) -> bool:
    """Return whether the surface under the belly reaches up to it."""
    east, north, z = under
    rises = z - (plane[0] * east + plane[1] * north + plane[2])
    upright = 1.0 / math.sqrt(1.0 + plane[0] ** 2 + plane[1] ** 2)
    return bool(np.nanmax(rises) * upright > clearance_m)
