"""What the planes of a box of cells say of landing there."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from slz.kernels.certainty import certainty
from slz.kernels.jit import kernel
from slz.kernels.record import HEIGHT, IS_SAFE, IS_UNKNOWN, IS_UNSAFE, TOP

SIGMAS = 3.0  # standard errors that the slope keeps from its limit

Layers = NDArray[np.float32]


@kernel(
    "Tuple((float32[:, :, ::1], uint8[:, :, ::1]))(float32[:, :, :], float32[:, :, :], uint8[:, :], float32,"
    " float32)"
)
def verdict(
    cells: Layers, fits: Layers, unseen: NDArray[np.uint8], slope_limit_deg: float, relief_limit_m: float
) -> tuple[Layers, NDArray[np.uint8]]:
    """Return the maps of a box, and whether each of its cells is safe, unsafe or unknown.

    Parameters
    ----------
    cells
        (6, rows, cols) of `summary.summarise`.
    fits
        (7, rows, cols) of `footprint.planes`.
    unseen
        (rows, cols), not 0 where a footprint holds unseen ground.

    Returns
    -------
    (7, rows, cols) height, top (m), slope, its standard error (deg), relief, roughness (m), certainty; NaN,
    of certainty 0, where unknown. (1, rows, cols) state: `slz.maps.SAFE`, `UNSAFE` or `UNKNOWN`.
    """
    rows, cols = unseen.shape
    values = np.full((7, rows, cols), np.float32(np.nan))
    told = np.full((1, rows, cols), IS_UNKNOWN)
    for r in range(rows):
        for c in range(cols):
            values[0, r, c], values[1, r, c] = cells[HEIGHT, r, c], cells[TOP, r, c]
            values[6, r, c] = 0
            slope, sigma, relief = fits[0, r, c], fits[1, r, c], fits[2, r, c]
            even = slope + np.float32(SIGMAS) * sigma < slope_limit_deg and relief < relief_limit_m
            if np.isnan(slope) or (even and unseen[r, c]):
                continue
            told[0, r, c] = IS_SAFE if even else IS_UNSAFE
            values[2, r, c], values[3, r, c], values[4, r, c] = slope, sigma, relief
            values[5, r, c] = fits[3, r, c]
            if not unseen[r, c]:
                values[6, r, c] = certainty(
                    slope, sigma, relief, fits[5, r, c], fits[4, r, c], fits[6, r, c],
                    slope_limit_deg, relief_limit_m,
                )  # fmt: skip
    return values, told
