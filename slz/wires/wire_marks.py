"""Marks of wires on the maps: points along them that raise the tops of the ground below."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from slz.grid import Edges
from slz.wires.detected_wire import Wire

STEP_M = 0.1
MOST_ASIDE_M, MOST_HIGHER_M = 1.0, 3.0
SIGMAS = 2.0  # of the place across the wire, and of its height
MOVED_M, RISEN_M, LONGER_M = 0.1, 0.2, 1.0  # from where a wire was marked, up to which its marks stay
CHUNK = 100  # marks along a wire with edges of their own

Floats = NDArray[np.float64]


class WireMarks:
    """Points along all wires, renewed only where a wire has moved: maps are derived again there.

    Attributes
    ----------
    points_m
        (n, 3), in the heights of the wires given.
    """

    def __init__(self) -> None:
        self._marked: dict[int, tuple[Wire, Floats]] = {}
        self.points_m: Floats = np.empty((0, 3))

    def update(self, wires: Iterable[Wire]) -> list[Edges]:
        """Mark the wires known now; return the edges (west, south, east, north) of places that change."""
        altered: list[Edges] = []
        marked: dict[int, tuple[Wire, Floats]] = {}
        for wire in wires:
            before = self._marked.pop(wire.number, None)
            if before is not None and _is_alike(before[0], wire):
                marked[wire.number] = before
                continue
            points = _marks(wire)
            marked[wire.number] = wire, points
            altered += [*_edges(points), *([] if before is None else _edges(before[1]))]
        for _, points in self._marked.values():
            altered += _edges(points)
        if altered:
            self.points_m = np.concatenate([np.empty((0, 3)), *(points for _, points in marked.values())])
        self._marked = marked
        return altered


def _marks(wire: Wire) -> Floats:
    """Return points (n, 3) along a wire, beside and over it as far as its place is uncertain."""
    points, height_sd_m, _ = wire.sampled(STEP_M)
    points[:, 2] += np.minimum(MOST_HIGHER_M, SIGMAS * height_sd_m)
    aside_m = min(MOST_ASIDE_M, SIGMAS * wire.curve.aside_sd_m)
    count = int(np.ceil(aside_m / STEP_M))
    across = np.array([-wire.curve.along[1], wire.curve.along[0], 0.0])
    return np.concatenate([points + k * STEP_M * across for k in range(-count, count + 1)])


def _edges(points: Floats) -> list[Edges]:
    parts = (points[k : k + CHUNK, :2] for k in range(0, len(points), CHUNK))
    return [(*part.min(axis=0).tolist(), *part.max(axis=0).tolist()) for part in parts]


def _is_alike(old: Wire, new: Wire) -> bool:
    """Return whether a wire is still where it was marked."""
    places = old.curve.points_enu_m(np.linspace(old.from_m, old.to_m, 7))
    along_m, across_m = new.curve.distances_m(places)
    risen_m = np.abs(new.curve.height_m(along_m) - places[:, 2])
    longer_m = max(along_m.min() - new.from_m, new.to_m - along_m.max())
    return bool(np.abs(across_m).max() < MOVED_M and risen_m.max() < RISEN_M and longer_m < LONGER_M)
