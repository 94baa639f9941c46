"""Wald's sequential test of returns: object or airborne particle, by the rays through a ball around each."""

from __future__ import annotations

import math

import numpy as np

from slz.kernels.argument_types import Array1D, Array2D, Array3D, ReadOnly1D, ReadOnly2D, Strided1D
from slz.kernels.jit import kernel, kernel_part
from slz.kernels.points.ray_image import (
    BEFORE,
    HITS,
    REFERENCE,
    THROUGH,
    count_in,
)

OBJECT, UNDECIDED, SPECK = 0, 1, 2
LEAST_BALL_M, MOST_BALL_M = 0.06, 0.9  # bounds of the ball's radius
VOXEL_M = 0.3  # of places where an object is certain
SLOTS = 1 << 16
OPAQUE = 0.3  # share of the rays that end in a ball with an object that lets none pass
PRIOR = 0.1  # returns of clutter before the ball that are assumed besides those seen
DUSTY = 2.5  # most that the specks measured at a range weigh against a return there
SURE = 3.0  # log-likelihood ratio that decides: wrong in one of 20 at the most
SHELLS, SHELL_M, FADES = 25, 1.0, 0.95  # of range, in which the density of specks is measured
CERTAIN = 6.0  # from which the place counts as an object's for a while


@kernel_part
def ball_m(away: float, spread: float) -> float:
    """Return the radius of the ball in which a return's neighbours are counted, by its angle."""
    return min(MOST_BALL_M, max(LEAST_BALL_M, spread * away))


@kernel_part
def likelihoods(
    counts: Array1D[np.float64], radius: float, wire_m: float, bonus: float, rate: float
) -> tuple[float, float]:
    """Return the log-odds of a wire and of the likelier object against clutter (Poisson counts).

    An object's returns are those of a wire across the ball, or of a solid that fills it; clutter's as many as
    in the reference length before the ball, or as everywhere at that range if they are more, in proportion to
    the mean chord and to the rays.

    Parameters
    ----------
    counts, radius
        (3,) rays, and radius of the ball, m.
    wire_m
        Diameter of the thinnest object that must not be taken for a speck.
    bonus
        What the intensity adds.
    rate
        Specks per ray and metre at that range.
    """
    hits, through, before = counts[HITS], counts[THROUGH], counts[BEFORE]
    if through <= 0:
        return bonus, 0.0
    chord = radius * 4.0 / 3.0
    local = (before + PRIOR) / (REFERENCE * radius * (through + before))
    clutter = max(local, rate) * chord * through
    wire, solid = through * 2.0 * wire_m / (math.pi * radius), through * OPAQUE
    by_wire = hits * math.log1p(wire / clutter) - wire + bonus
    by_solid = hits * math.log1p(solid / clutter) - solid + bonus
    return by_wire, (max(by_wire, by_solid) if hits > 0 else 0.0)


@kernel_part
def _verdict(wire: float, best: float, dustiness: float) -> int:
    """Return the verdict of Wald's sequential test; a speck must be unlike the thinnest wire."""
    if best >= SURE:
        return OBJECT
    return SPECK if wire - dustiness <= -SURE else UNDECIDED


@kernel_part
def _voxel(x: float, y: float, z: float) -> tuple[int, int]:
    """Return the key of a place's voxel and its slot."""
    mask = (1 << 20) - 1
    a, b = math.floor(x / VOXEL_M) & mask, math.floor(y / VOXEL_M) & mask
    key = (((a << 20) | b) << 20) | (math.floor(z / VOXEL_M) & mask)
    return key, (key * 0x5851F42D4C957F2D >> 33) & (SLOTS - 1)


@kernel_part
def _rate(air: Array2D[np.float64], away: float) -> float:
    """Return the specks per ray and metre at a range; 0 where too few rays were counted."""
    shell = min(SHELLS - 1, int(away / SHELL_M))
    return air[shell, 0] / air[shell, 1] if air[shell, 1] > 0 else 0.0


@kernel_part
def _dustiness(air: Array2D[np.float64], away: float) -> float:
    """Return what the number of specks at a range weighs against a return there (log-odds)."""
    return min(DUSTY, math.log1p(air[min(SHELLS - 1, int(away / SHELL_M)), 0]))


@kernel_part
def _measure(away: Array1D[np.float64], verdicts: Array1D[np.uint8], air: Array2D[np.float64]) -> None:
    """Add a scan's specks and lengths of rays to those of the shells, and let earlier ones fade."""
    ends = np.zeros(SHELLS + 1)
    for shell in range(SHELLS):
        air[shell, 0] *= FADES
        air[shell, 1] *= FADES
    for i in range(len(away)):
        shell = min(SHELLS, int(away[i] / SHELL_M)) if away[i] < np.inf else SHELLS
        ends[shell] += 1
        if verdicts[i] == SPECK and shell < SHELLS:
            air[shell, 0] += 1
    through = ends[SHELLS]
    for shell in range(SHELLS - 1, -1, -1):
        air[shell, 1] += (through + ends[shell] / 2) * SHELL_M
        through += ends[shell]


@kernel
def judge(
    points: ReadOnly2D[np.float64],
    bonus: ReadOnly1D[np.float64],
    spread: float,
    wire_m: float,
    reach: float,
    newest: int,
    stored: int,
    sensors: Array2D[np.float64],
    first: Array1D[np.int64],
    rays: Array3D[np.float32],
    weights: Array2D[np.int32],
    starts: Array2D[np.int32],
    slots: Array1D[np.int32],
    clutter: Array2D[np.int32],
    air: Array2D[np.float64],
    certain: Array2D[np.int64],
    now_ns: int,
    certain_ns: int,
    verdicts: Array1D[np.uint8],
    counts: Array2D[np.float64],
) -> None:
    """Judge the returns of the newest scan by its rays and those of the scans before, newest first.

    Parameters
    ----------
    points, bonus
        (n, 3) returns, and (n,) what their intensity adds to the log-likelihood ratio of an object.
    spread
        Radius of the ball around a return, as a share of its range.
    wire_m
        Diameter of the thinnest object that must not be taken for a speck.
    reach
        Range up to which returns are judged; farther ones count as objects.
    newest, stored
        Number of the scan in the ring, and how many are stored.
    slots, clutter
        (n,) where each return's ray is stored, and weights of the rays that may have ended in a speck;
        those of the newest scan are changed.
    air
        (SHELLS, 2) specks, and metres of rays, in each shell of range, of the last second or so; changed.
    certain
        (SLOTS, 2) voxels where an object was certain, and when; changed. A return in one is of that object
        for `certain_ns`, then it is judged again.
    verdicts, counts
        (n,) and (n, 3), changed.
    """
    sensor = sensors[newest]
    away = np.empty(len(points))
    judged = np.zeros(len(points), np.bool_)
    for i in range(len(points)):
        x, y, z = points[i, 0] - sensor[0], points[i, 1] - sensor[1], points[i, 2] - sensor[2]
        away[i] = math.sqrt(x * x + y * y + z * z)
        if 0 < away[i] <= reach:
            key, slot = _voxel(points[i, 0], points[i, 1], points[i, 2])
            judged[i] = certain[slot, 0] != key or not 0 < now_ns - certain[slot, 1] <= certain_ns
        verdicts[i] = OBJECT
        if not judged[i] and slots[i] >= 0:
            clutter[newest, slots[i]] = 0
    for i in range(len(points)):
        if not judged[i]:
            continue
        east, north, up = points[i, 0], points[i, 1], points[i, 2]
        radius, rate = ball_m(away[i], spread), _rate(air, away[i])
        found, wire, best = UNDECIDED, 0.0, 0.0
        for k in range(stored):
            at = (newest - k) % len(sensors)
            count_in(
                east, north, up, radius, sensors[at], first, rays[at], weights[at], clutter[at], starts[at],
                counts[i],
            )  # fmt: skip
            wire, best = likelihoods(counts[i], radius, wire_m, bonus[i], rate)
            found = _verdict(wire, best, 0.0)
            if found != UNDECIDED:
                break
        if found == UNDECIDED:  # by all rays, and by the dust at that range
            found = _verdict(wire, best, _dustiness(air, away[i]))
        verdicts[i] = found
        if best >= CERTAIN:
            key, slot = _voxel(east, north, up)
            if (now_ns, key) > (certain[slot, 1], certain[slot, 0]):
                certain[slot, 0], certain[slot, 1] = key, now_ns
    for i in range(len(points)):
        if verdicts[i] == OBJECT and slots[i] >= 0:
            clutter[newest, slots[i]] = 0
    _measure(away, verdicts, air)


@kernel
def judge_again(
    points: Array2D[np.float64],
    bonus: Array1D[np.float64],
    away: Array1D[np.float64],
    radius: Array1D[np.float64],
    wire_m: float,
    sensor: Strided1D[np.float64],
    first: Array1D[np.int64],
    rays: Array2D[np.float32],
    weights: Array1D[np.int32],
    clutter: Array1D[np.int32],
    starts: Array1D[np.int32],
    air: Array2D[np.float64],
    counts: Array2D[np.float64],
    verdicts: Array1D[np.uint8],
) -> None:
    """Judge undecided returns of earlier scans, then `away` metres off, by a new one's rays too."""
    for i in range(len(points)):
        east, north, up = points[i, 0], points[i, 1], points[i, 2]
        count_in(
            east, north, up, radius[i], sensor, first, rays, weights, clutter, starts, counts[i]
        )  # fmt: skip
        wire, best = likelihoods(counts[i], radius[i], wire_m, bonus[i], _rate(air, away[i]))
        verdicts[i] = _verdict(wire, best, _dustiness(air, away[i]))
