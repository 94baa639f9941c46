"""Rays and top views through the layers over the ground: standing water, plants and snow.

A ray goes square by square from where it falls below the top of all layers, to the opaque surface that the
ray caster has found. Water ends it. In plants it gathers optical depth, and each part of the beam ends where
that exceeds its own depth: drawn from the exponential distribution, these are the places where it meets a
leaf.
"""

from __future__ import annotations

import math

import numpy as np

from sitl.array_types import Array1D, Array2D
from sitl.compilation import kernel, kernel_part
from sitl.world.raycast import ground_square, slab
from sitl.world.tables import F64, INF, GroundTable, LayerTable

STEP_OF_HEIGHT = 0.15
MOST_STEP_M = 0.1
CLUMP_M, PATCH_M = 0.4, 6.0


@kernel_part
def _lattice(i: int, j: int) -> float:
    """Return a fixed random number of a lattice point, -1 to 1."""
    h = (i * 374761393 + j * 668265263 + 144665) & 0x7FFFFFFF
    h = ((h ^ (h >> 13)) * 1274126177) & 0x7FFFFFFF
    return (h ^ (h >> 16)) / 1073741823.5 - 1.0


@kernel_part
def _noise(x: float, y: float, pitch: float) -> float:
    """Return fixed smooth noise, -1 to 1, by interpolation between lattice points."""
    i, j = math.floor(x / pitch), math.floor(y / pitch)
    u, v = x / pitch - i, y / pitch - j
    low = _lattice(i, j) * (1 - u) + _lattice(i + 1, j) * u
    high = _lattice(i, j + 1) * (1 - u) + _lattice(i + 1, j + 1) * u
    return low * (1 - v) + high * v


@kernel_part
def plant_height(plants: F64, p: int, x: float, y: float) -> float:
    """Return the height of a stand of plants over the ground at a place."""
    uneven = 0.6 * _noise(x, y, CLUMP_M) + 0.4 * _noise(x + 71.3, y - 33.7, PATCH_M)
    return float(plants[p, 1] * (1.0 + plants[p, 3] * uneven))


@kernel_part
def _extinction(plants: F64, p: int, x: float) -> float:
    if plants[p, 4] == 0.0:
        return float(plants[p, 2])
    return float(plants[p, 2] * (1.0 + plants[p, 5] * math.cos(2.0 * math.pi * x / plants[p, 4])))


@kernel_part
def _height_in_square(z: F64, j: int, i: int, u: float, v: float) -> float:
    low = z[j, i] * (1 - u) + z[j, i + 1] * u
    high = z[j + 1, i] * (1 - u) + z[j + 1, i + 1] * u
    return float(low * (1 - v) + high * v)


@kernel
def cast_layers(
    ground: GroundTable,
    layers: LayerTable,
    origins: Array2D[np.float64],
    directions: Array2D[np.float64],
    floor: Array1D[np.float64],
    limit: float,
    depths: Array2D[np.float64],
    out_water: Array1D[np.float64],
    out_depth: Array1D[np.float64],
    out_bottom: Array1D[np.uint8],
    out_leaf: Array2D[np.float64],
    out_plant: Array1D[np.uint8],
) -> None:
    """Cast every ray through the layers in front of its opaque hit.

    Parameters
    ----------
    floor
        (n,) range of the opaque hit, NaN for none.
    limit
        Greatest range.
    depths
        (n, k) optical depth at which each part of the beam meets a leaf.
    out_water, out_depth, out_bottom
        (n,) range of the water, NaN for none, the depth below that place and the material of its bottom.
    out_leaf, out_plant
        (n, k) range of each part's leaf, NaN for none; kind of the plants.
    """
    z, kinds, meta = ground
    water, plant, plants, top = layers
    rows, columns = plant.shape
    post, x0, y0 = meta[2], meta[0], meta[1]
    parts = depths.shape[1]
    for n in range(origins.shape[0]):
        out_water[n], out_depth[n], out_bottom[n], out_plant[n] = math.nan, 0.0, 0, 0
        out_leaf[n, :] = math.nan
        ox, oy, oz = origins[n, 0], origins[n, 1], origins[n, 2]
        dx, dy, dz = directions[n, 0], directions[n, 1], directions[n, 2]
        if not math.isfinite(ox + oy + oz + dx + dy + dz):
            continue
        t_end = limit if math.isnan(floor[n]) else floor[n]
        t, b = slab(oz, dz, -INF, top[0])
        t, t_end = max(t, 0.0), min(t_end, b)
        a, b = slab(ox, dx, x0, x0 + columns * post)
        t, t_end = max(t, a), min(t_end, b)
        a, b = slab(oy, dy, y0, y0 + rows * post)
        t, t_end = max(t, a), min(t_end, b)
        if not t < t_end:
            continue
        u, v, du, dv = (ox - x0) / post, (oy - y0) / post, dx / post, dy / post
        i = min(max(math.floor(u + t * du), 0), columns - 1)
        j = min(max(math.floor(v + t * dv), 0), rows - 1)
        next_u = (i + (du > 0) - u) / du if du != 0.0 else INF
        next_v = (j + (dv > 0) - v) / dv if dv != 0.0 else INF
        gathered, left = 0.0, parts
        while True:
            leave = min(next_u, next_v, t_end)
            wet = False
            if dz < 0.0 and not math.isnan(water[j, i]):
                down = (water[j, i] - oz) / dz
                if t <= down <= leave and down < t_end:
                    bed = _height_in_square(z, j, i, u + down * du - i, v + down * dv - j)
                    if bed < water[j, i]:
                        out_water[n], out_depth[n], out_bottom[n] = down, water[j, i] - bed, kinds[j, i]
                        leave, wet = down, True
            if plant[j, i] > 0 and left > 0 and leave > t:
                p = int(plant[j, i]) - 1
                tallest = plants[p, 1] * (1.0 + plants[p, 3])
                enter = oz + t * dz - _height_in_square(z, j, i, u + t * du - i, v + t * dv - j)
                exit_ = oz + leave * dz - _height_in_square(z, j, i, u + leave * du - i, v + leave * dv - j)
                if min(enter, exit_) <= tallest:
                    count = math.ceil((leave - t) / min(MOST_STEP_M, STEP_OF_HEIGHT * plants[p, 1]))
                    step = (leave - t) / count
                    sinks = (enter - exit_) / count
                    for k in range(count):
                        at = t + (k + 0.5) * step
                        x, y = ox + at * dx, oy + at * dy
                        over = oz + at * dz - _height_in_square(z, j, i, u + at * du - i, v + at * dv - j)
                        half = 0.5 * abs(sinks)
                        if over - half > tallest:
                            continue
                        inside = plant_height(plants, p, x, y) - over + half
                        if inside <= 0.0:
                            continue
                        # The part of the step below the top: its end on the way down, else its beginning.
                        part = 1.0 if inside >= 2.0 * half else inside / (2.0 * half)
                        begin = at + 0.5 * step - part * step if sinks > 0.0 else at - 0.5 * step
                        more = _extinction(plants, p, x) * part * step
                        out_plant[n] = np.uint8(plants[p, 0])
                        for q in range(parts):
                            if math.isnan(out_leaf[n, q]) and depths[n, q] <= gathered + more:
                                share = (depths[n, q] - gathered) / more
                                out_leaf[n, q] = begin + share * part * step
                                left -= 1
                        gathered += more
                        if left == 0:
                            break
            if wet or left == 0 or leave >= t_end:
                break
            t = max(t, leave)
            if next_u <= next_v:
                i += 1 if du > 0 else -1
                next_u += abs(1.0 / du)
            else:
                j += 1 if dv > 0 else -1
                next_v += abs(1.0 / dv)
            if i < 0 or j < 0 or i >= columns or j >= rows:
                break


@kernel
def top_layers(
    ground: GroundTable,
    layers: LayerTable,
    xs: Array1D[np.float64],
    ys: Array1D[np.float64],
    water_kind: int,
    puddle_kind: int,
    puddle_m: float,
    out_z: Array1D[np.float64],
    out_kind: Array1D[np.uint8],
) -> None:
    """Raise heights and materials seen from above to those of the layers; NaN stays.

    Water up to `puddle_m` deep is of `puddle_kind`, deeper water of `water_kind`.
    """
    water, plant, plants, _ = layers
    for n in range(xs.size):
        if math.isnan(out_z[n]):
            continue
        x, y = xs[n], ys[n]
        j, i, u, v = ground_square(ground, x, y)
        bed = _height_in_square(ground[0], j, i, u, v)
        if water[j, i] > bed and water[j, i] > out_z[n]:
            out_kind[n] = water_kind if water[j, i] - bed > puddle_m else puddle_kind
            out_z[n] = water[j, i]
        if plant[j, i] > 0:
            p = int(plant[j, i]) - 1
            above = bed + plant_height(plants, p, x, y)
            if above > out_z[n]:
                out_z[n], out_kind[n] = above, np.uint8(plants[p, 0])
