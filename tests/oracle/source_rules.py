"""Slow reference of the sources' rules, recomputed for every window (SLZ paper, Sections 3.2 to 3.4)."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

Floats = NDArray[np.float64]
Map = NDArray[np.bool_]
EIGHT = np.ones((3, 3))
RING = [(0, -1), (-1, -1), (-1, 0), (-1, 1), (0, 1), (1, 1), (1, 0), (1, -1)]  # clockwise from west


def histogram_interval(height_m: Floats, bins: int, threshold: float) -> tuple[float, float]:
    """Heights accepted by the rule that `slz/kernels/paper/height_gate.py` tells: sparse ends are trimmed."""
    low, high = float(height_m.min()), float(height_m.max())
    if not high > low:
        return low, high
    scale = bins / (high - low)
    count = [0] * bins
    for height in height_m:
        count[min(bins - 1, int((height - low) * scale))] += 1
    sparse = (1 - threshold) * len(height_m) / bins
    first, last, left = 0, bins - 1, len(height_m)
    while first < last:
        fewer = min(count[first], count[last])
        if fewer >= sparse or left - fewer < threshold * len(height_m):
            break
        left -= fewer
        if count[first] <= count[last]:
            first += 1
        else:
            last -= 1
    return low + first / scale, low + (last + 1) / scale


def moore(safe: Map, row: int, col: int) -> list[tuple[int, int]]:
    """Moore tracing from a component's first cell, until a step of that cell is taken a second time."""
    here, back, first = (row, col), (row, col - 1), None
    path: list[tuple[int, int]] = []
    while True:
        start = RING.index((back[0] - here[0], back[1] - here[1]))
        for k in range(1, 9):
            down, right = RING[(start + k) % 8]
            there = here[0] + down, here[1] + right
            if safe[there]:
                break
            back = there
        else:
            return [here]
        if here == (row, col):
            if first == there:
                return path
            first = first or there
        path.append(here)
        here = there


@dataclass
class Found:
    """A zone: its contour, the cells on and inside it, the cells of its component."""

    boundary: list[tuple[int, int]]
    content: Map
    component: Map


def zones_of(safe: Map, side: int, least_boundary: int) -> list[Found]:
    """Zones of a binary map with an unsafe margin, in the order of their first cells."""
    label, count = ndimage.label(safe, EIGHT)
    found: list[Found] = []
    taken = np.zeros(safe.shape, bool)
    for number in range(1, count + 1):
        component = label == number
        row, col = (int(i) for i in np.argwhere(component)[0])
        if taken[row, col] or not ndimage.binary_erosion(component, np.ones((side, side))).any():
            continue
        boundary = moore(safe, row, col)
        if len(boundary) >= least_boundary:
            found.append(Found(boundary, ndimage.binary_fill_holes(component), component))
            taken |= found[-1].content
    return found


@dataclass
class Kept:
    """A zone in effect."""

    id: int
    zone: Found
    n_safe: int
    n_known: int


class Repeats:
    """The filter of repeated zones with an unlimited list (SLZ paper, section 3.4.3, Eq. 18)."""

    def __init__(self, ratio: float = 0.8, area_ratio: float = 0.9) -> None:
        self.kept: list[Kept] = []
        self._ratio, self._area_ratio = ratio, area_ratio

    def update(self, found: list[Found], safe: Map, known: Map) -> None:
        for zone in found:
            n_safe, n_known = int((zone.content & safe).sum()), int((zone.content & known).sum())
            for position, old in enumerate(self.kept):
                n = sum(bool(old.zone.content[cell]) for cell in zone.boundary)
                if n == len(zone.boundary):
                    break
                larger = zone.content.sum() > self._area_ratio * old.zone.content.sum()
                if n / len(zone.boundary) > self._ratio and larger:
                    self.kept[position] = Kept(old.id, zone, n_safe, n_known)
                    break
            else:
                self.kept.append(Kept(len(self.kept) + 1, zone, n_safe, n_known))


def largest_square(component: Map) -> int:
    side = 1
    while ndimage.binary_erosion(component, np.ones((side + 1, side + 1))).any():
        side += 1
    return side


def distances(component: Map) -> Floats:
    """Distance of every cell's centre to that of the nearest cell outside."""
    return np.asarray(ndimage.distance_transform_edt(np.pad(component, 1))[1:-1, 1:-1])


def interval(height: Floats, bins: int, threshold: float) -> tuple[float, float]:
    """Accepted heights by the histogram rule of `slz.points.outliers`, by plain counting."""
    low, high = float(height.min()), float(height.max())
    if low == high:
        return low, high
    scale = bins / (high - low)
    count = [0] * bins
    for z in height.tolist():
        count[min(bins - 1, math.floor((z - low) * scale))] += 1
    first, last, left = 0, bins - 1, len(height)
    while first < last:
        n = min(count[first], count[last])
        if n >= (1 - threshold) * len(height) / bins or left - n < threshold * len(height):
            break
        left -= n
        if count[first] <= count[last]:
            first += 1
        else:
            last -= 1
    return low + first / scale, low + (last + 1) / scale
