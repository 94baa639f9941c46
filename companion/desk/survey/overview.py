"""Overview picture of a survey's ground at reduced resolution: hillshade, tinted by state."""

from __future__ import annotations

import io
import math

import numpy as np
from numpy.typing import NDArray

from companion.desk.figures.picture import FLAT, filled, shade
from companion.desk.survey.findings import Maps
from params import Parameters
from slz import SAFE, UNKNOWN, Box, Grid

MOST_PIXELS = 1200  # on a side
STRIP, WIDE = 1024, 4096  # rows and columns read at a time
SAFE_TINT, UNSAFE_TINT, UNKNOWN_TINT, WATER_TINT = (
    (0.85, 0.91, 0.83), (0.93, 0.87, 0.80), (0.98, 1.0, 1.0), (0.55, 0.76, 0.98),
)  # fmt: skip
DARKEST, CONTRAST = 0.35, 0.75  # of a tint, by the hillshade


def subsampled(maps: Maps, name: str, step: int) -> NDArray[np.generic]:
    """Return every `step`-th row and column of a layer; row 0 is the southernmost."""
    rows, cols = maps.grid.rows, maps.grid.cols
    strip, wide = (most // step * step or step for most in (STRIP, WIDE))
    bands = []
    for row in range(0, rows, strip):
        boxes = [Box(row, min(row + strip, rows), col, min(col + wide, cols)) for col in range(0, cols, wide)]
        # Copies, since a view would keep all cells that were read in memory.
        parts = [maps.read(name, box)[::step, ::step].copy() for box in boxes]
        bands.append(np.concatenate(parts, axis=1))
    return np.concatenate(bands)


def step_of(grid: Grid) -> int:
    """Return the number of cells per pixel of the picture along a side."""
    return max(1, math.ceil(max(grid.rows, grid.cols) / MOST_PIXELS))


def water_mask(maps: Maps, parameters: Parameters) -> NDArray[np.bool_]:
    """Return the mask of subsampled cells that may be water; none in source mode, which judges no water."""
    if parameters.mode == "source":
        return np.zeros((1, 1), bool)
    return np.asarray(subsampled(maps, "water", step_of(maps.grid)), np.float64) > parameters.water_suspicion


def legend() -> dict[str, str]:
    """Return the meaning of the overview's colours, by colour of level ground."""
    tints = {
        SAFE_TINT: "safe, too small to land in",
        UNSAFE_TINT: "unsafe: steep, rough or near an obstacle",
        UNKNOWN_TINT: "unknown: too few returns",
        WATER_TINT: "may be water: taken as unknown",
    }
    light = DARKEST + CONTRAST * FLAT
    return {"#" + bytes(round(255 * c * light) for c in tint).hex(): text for tint, text in tints.items()}


def ground_png(maps: Maps, water: NDArray[np.bool_] | bool = False) -> bytes:
    """Return the overview as PNG, north up; water: `water_mask` of the maps."""
    from PIL import Image

    step = step_of(maps.grid)
    state = subsampled(maps, "state", step)
    height = filled(np.asarray(subsampled(maps, "height_m", step), np.float32))
    light = (DARKEST + CONTRAST * shade(height, maps.grid.cell_m * step)).clip(0, 1)
    tint = np.where((state == SAFE)[..., None], SAFE_TINT, UNSAFE_TINT)
    tint[state == UNKNOWN] = UNKNOWN_TINT
    tint[(state == UNKNOWN) & water] = WATER_TINT
    picture = np.round(255 * tint * light[..., None]).astype(np.uint8)
    out = io.BytesIO()
    Image.fromarray(picture[::-1]).save(out, "PNG", optimize=False, compress_level=6)
    return out.getvalue()
