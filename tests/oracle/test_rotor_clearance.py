"""Gear, rotor and tail against brute force in plain NumPy over exact height fields.

The brute force shares no code with the kernels: it stands four pads on pixels of 5 cm, at any touchdown
within the error and any yaw within 10 degrees of a heading, on every plane on which they can rest. None may
be beyond the tip limit, and the columns of the pixels may not meet disc and tail. `python -m
tests.oracle.test_rotor_clearance N` checks N headings.
"""

from __future__ import annotations

import math
import sys
from dataclasses import dataclass
from itertools import combinations

import numpy as np
import pytest
from numpy.typing import NDArray

import params
from slz.kernels.cells.cell_record import BOTTOM, EXCESS, HEIGHT, SPREAD, SUMMARY_LAYERS, TOP, WEIGHT
from slz.terrain.derive import reach_of
from slz.terrain.footing import footing, footing_edge

Floats = NDArray[np.float64]
PIXEL_M = 0.05
YAW_DEG = 10.0
TOUCHDOWNS = 2  # tried per heading
UNSEEN = np.inf
TIPS = math.tan(math.radians(15)) * (1 + 1e-6)  # gradient beyond which the gear does not stand


@dataclass(frozen=True, slots=True)
class Vehicle:
    """Vehicle of a trial, its sizes in metres."""

    gear_m: float
    rotor_m: float
    rotor_height_m: float
    tail_m: float
    tail_width_m: float
    tail_height_m: float
    clearance_m: float
    cell_m: float
    error_m: float

    @classmethod
    def some(cls, rng: np.random.Generator) -> Vehicle:
        gear_m = rng.uniform(0.4, 0.7)
        clearance_m = rng.uniform(0.1, 0.3)
        rotor_m, tail_m = rng.uniform(1.0, 3.0), rng.uniform(0.8, 2.2)
        parts = rng.integers(3)  # both, disc alone, tail alone
        return cls(
            gear_m=gear_m,
            rotor_m=0.0 if parts == 2 else rotor_m,
            rotor_height_m=clearance_m + rng.uniform(0.15, 0.8),
            tail_m=0.0 if parts == 1 else tail_m,
            tail_width_m=rng.uniform(0.05, 0.5),
            tail_height_m=clearance_m + rng.uniform(0.05, 0.5),
            clearance_m=clearance_m,
            cell_m=float(rng.choice([0.1, 0.15, 0.2, 0.25])),
            error_m=float(rng.choice([0.0, 0.1, 0.3])),
        )

    def parameters(self) -> params.Parameters:
        return params.build(
            {
                "gear_length_m": self.gear_m,
                "gear_width_m": self.gear_m,
                "rotor_diameter_m": self.rotor_m,
                "rotor_height_m": self.rotor_height_m,
                "tail_length_m": self.tail_m,
                "tail_width_m": self.tail_width_m,
                "tail_height_m": self.tail_height_m,
                "rotor_clearance_m": self.clearance_m,
                "cell_m": self.cell_m,
                "coverage_m": self.cell_m,
                "touchdown_error_m": self.error_m,
            }
        )


def field(rng: np.random.Generator, side: int) -> Floats:
    """Heights of the pixels, indexed [north, east]: a slope with steps, posts, walls, bushes and trees."""
    north, east = (np.mgrid[:side, :side] + 0.5) * PIXEL_M
    bearing, slope = rng.uniform(0, 2 * math.pi), math.tan(math.radians(rng.uniform(0, 9)))
    high = slope * (east * math.sin(bearing) + north * math.cos(bearing))
    if rng.random() < 0.3:
        step = rng.uniform(0, side * PIXEL_M)
        high += rng.uniform(0.02, 0.12) * (east * math.cos(bearing) + north * math.sin(bearing) > step)
    if rng.random() < 0.3:
        high += rng.uniform(0, 0.03, high.shape)
    ground = high.copy()
    for _ in range(rng.integers(0, 9)):
        at_north, at_east = rng.uniform(0, side * PIXEL_M, 2)
        over_m = rng.uniform(0.05, 1.5)
        match rng.integers(4):
            case 0:  # post
                inside = np.hypot(north - at_north, east - at_east) < rng.uniform(0.03, 0.1)
            case 1:  # wall
                turn = rng.uniform(0, math.pi)
                along = (east - at_east) * math.sin(turn) + (north - at_north) * math.cos(turn)
                across = (east - at_east) * math.cos(turn) - (north - at_north) * math.sin(turn)
                inside = (np.abs(across) < rng.uniform(0.04, 0.2)) & (np.abs(along) < rng.uniform(0.3, 4))
            case 2:  # bush
                inside = np.hypot(north - at_north, east - at_east) < rng.uniform(0.2, 0.7)
            case _:  # tree
                inside, over_m = np.hypot(north - at_north, east - at_east) < rng.uniform(0.5, 1.5), 3.0
        high = np.where(inside, np.maximum(high, ground + over_m), high)
    return high


def statistics(high: Floats, unseen: NDArray[np.bool_], pixels: int) -> NDArray[np.float32]:
    """Cell statistics of exact returns, one per pixel; NaN and 0 in unseen cells."""
    rows, cols = (n // pixels for n in high.shape)
    blocks = high[: rows * pixels, : cols * pixels].reshape(rows, pixels, cols, pixels)
    cells = np.zeros((SUMMARY_LAYERS, rows, cols), np.float32)
    cells[HEIGHT], cells[BOTTOM] = blocks.mean(axis=(1, 3)), blocks.min(axis=(1, 3))
    cells[TOP], cells[SPREAD], cells[WEIGHT] = blocks.max(axis=(1, 3)), 1e-6, pixels**2
    for layer in (HEIGHT, BOTTOM, TOP, SPREAD, EXCESS):
        cells[layer][unseen] = np.nan
    cells[WEIGHT][unseen] = 0
    return cells


def rests(contacts: Floats, heights: Floats) -> list[tuple[float, float, float]]:
    """East and north gradient, and height at the centre, of every plane on which four pads can rest."""
    found = []
    for three in map(list, combinations(range(len(contacts)), 3)):
        design = np.column_stack([contacts[three], np.ones(3)])
        if abs(np.linalg.det(design)) < 1e-9:
            continue
        weights = np.linalg.solve(design.T, np.array([0.0, 0.0, 1.0]))  # of the centre in the triple
        a, b, c = np.linalg.solve(design, heights[three])
        if weights.min() > -1e-6 and (contacts @ (a, b) + c >= heights - 1e-6).all():
            found.append((float(a), float(b), float(c)))
    return found


def planes_at(
    vehicle: Vehicle, ground: Floats, touchdown: tuple[float, float], yaw: float
) -> list[tuple[float, float, float]]:
    """Return the planes on which pads can rest at a pose; ground: heights of all pixels, [north, east]."""
    sine, cosine, half = math.sin(yaw), math.cos(yaw), vehicle.gear_m / 2
    body = np.array([(x, y) for x in (half, -half) for y in (-half, half)])
    contacts = np.column_stack(
        [body[:, 0] * sine + body[:, 1] * cosine, body[:, 0] * cosine - body[:, 1] * sine]
    )
    at = np.floor((contacts + touchdown) / PIXEL_M).astype(int)
    return rests(contacts, ground[at[:, 1], at[:, 0]])


def touches(
    vehicle: Vehicle,
    pixels: Floats,
    high: Floats,
    planes: list[tuple[float, float, float]],
    touchdown: tuple[float, float],
    yaw: float,
    margin_m: float,
) -> bool:
    """Whether disc or tail meets the column of a pixel on one of the planes.

    Parameters
    ----------
    pixels, high
        (n, 2) east and north of the columns' centres, and (n,) their tops.
    margin_m
        Distance all around at which a column counts as met.
    """
    sine, cosine, half = math.sin(yaw), math.cos(yaw), vehicle.gear_m / 2
    away = pixels - touchdown
    for a, b, c in planes:
        long = math.sqrt(1 + a * a + b * b)
        normal = np.array([-a, -b, 1.0]) / long
        ahead = np.array([sine, cosine, a * sine + b * cosine])
        ahead /= np.linalg.norm(ahead)
        right = np.cross(ahead, normal)
        for is_disc, height_m in ((True, vehicle.rotor_height_m), (False, vehicle.tail_height_m)):
            if not (vehicle.rotor_m if is_disc else vehicle.tail_m):
                continue
            under_m = (height_m - margin_m) * long  # of the lower face, over the rest plane, plumb
            level = away @ (a, b) + c + under_m
            face = np.column_stack([away, level - c])  # where a column meets the plane of that face
            f, q = face @ ahead, face @ right
            if is_disc:
                inside = np.hypot(f, q) < vehicle.rotor_m / 2 + margin_m
            else:
                inside = (f < -half) & (f > -vehicle.tail_m - margin_m)
                inside &= np.abs(q) < vehicle.tail_width_m / 2 + margin_m
            if (inside & (high > level)).any():
                return True
    return False


@dataclass(slots=True)
class Count:
    """Headings called clear, and those of them that tip over, touch, or come within the margin."""

    headings: int = 0
    clear: int = 0
    tipping: int = 0
    touching: int = 0
    within_margin: int = 0


def trial(rng: np.random.Generator, count: Count, points: int = 8) -> None:
    """Check all headings at some points of a random world for a random vehicle."""
    vehicle = Vehicle.some(rng)
    p, per_cell = vehicle.parameters(), round(vehicle.cell_m / PIXEL_M)
    radius = reach_of(p, p.cell_m).radius
    edge = footing_edge(radius, p.cell_m, p)
    box = 2 * round(p.touchdown_error_m / p.cell_m) + 1
    side = box + 2 * edge + 12
    high = field(rng, side * per_cell)
    unseen = np.zeros((side, side), bool)
    if rng.random() < 0.5:
        row, col = rng.integers(0, side, 2)
        unseen[row : row + rng.integers(2, 8), col : col + rng.integers(2, 8)] = True
    cells = statistics(high, unseen, per_cell)
    truth = np.where(np.kron(unseen, np.ones((per_cell, per_cell), bool)), UNSEEN, high)
    north, east = (np.mgrid[: len(high), : len(high)] + 0.5) * PIXEL_M
    for _ in range(points):
        row, col = rng.integers(0, 12, 2)
        part = cells[:, row : row + box + 2 * edge, col : col + box + 2 * edge]
        found = footing(np.ascontiguousarray(part), box, box, radius, p.cell_m, p)
        count.headings += 24
        count.clear += len(found.headings_deg)
        if not found.headings_deg:
            continue
        begin = (np.array([col, row]) + edge) * p.cell_m
        middle, reach = begin + box * p.cell_m / 2, max(vehicle.rotor_m / 2, vehicle.tail_m) + 1.5
        near = (np.abs(east - middle[0]) < reach) & (np.abs(north - middle[1]) < reach)
        pixels, tops = np.column_stack([east[near], north[near]]), truth[near]
        raised = tops > np.median(high[near]) - 1 + p.rotor_clearance_m / 2
        pixels, tops = pixels[raised], tops[raised]
        for heading_deg in found.headings_deg:
            for _ in range(TOUCHDOWNS):
                there = begin + rng.uniform(0, box * p.cell_m, 2)
                yaw = math.radians(heading_deg + rng.uniform(-YAW_DEG, YAW_DEG))
                touchdown = float(there[0]), float(there[1])
                planes = planes_at(vehicle, high, touchdown, yaw)
                count.tipping += any(math.hypot(a, b) > TIPS for a, b, _ in planes)
                place = pixels, tops, planes, touchdown, yaw
                if touches(vehicle, *place, vehicle.clearance_m):
                    count.within_margin += 1
                    count.touching += touches(vehicle, *place, 0.0)


@pytest.mark.parametrize(
    "headings", [3_000, pytest.param(9_000, marks=pytest.mark.bench)]
)  # 9,000 on request
def test_no_heading_called_clear_tips_over_or_touches_anything(headings: int) -> None:
    rng, count = np.random.default_rng(7), Count()
    while count.headings < headings:
        trial(rng, count)
    assert count.tipping == 0
    assert count.touching == 0
    assert count.within_margin == 0
    assert count.clear > count.headings / 10


if __name__ == "__main__":
    rng, count = np.random.default_rng(int(sys.argv[2]) if len(sys.argv) > 2 else 0), Count()
    while count.headings < int(sys.argv[1]):
        trial(rng, count)
    print(count)
