"""Steps of stored coordinates: refusal of clouds whose scales are too coarse for cells and heights."""

from __future__ import annotations

import logging

from companion.runtime.errors import UsageError
from params import Parameters

log = logging.getLogger(__name__)

COARSE = 0.25  # of a cell: beyond that, the user is warned


def check_steps(
    owner: str,
    scales: tuple[float, float, float],
    lengths_m: tuple[float, float, float],
    parameters: Parameters,
) -> None:
    """Refuse steps of x or y longer than a cell, and steps of height that hide a slope from a footprint.

    Ground stored in steps of more than `relief_m` looks level between two steps.

    Parameters
    ----------
    owner
        File, for the error.
    scales
        Steps of x, y and z, in units of the CRS; 0 for floating point numbers.
    lengths_m
        Metres of one unit of x, y and z.

    Raises
    ------
    UsageError
        The steps are too coarse.
    """
    x_m, y_m, z_m = (scale * length for scale, length in zip(scales, lengths_m, strict=True))
    side_m, cell_m = max(x_m, y_m), parameters.cell_m
    told = ", ".join(f"{scale:g}" for scale in scales)
    if side_m > cell_m:
        raise UsageError(
            f"{owner}: its scales {told} put x and y {side_m:.3g} m apart, more than a cell of {cell_m:g} m:"
            " write it again with finer scales (1e-7 for degrees)"
        )
    if z_m > parameters.relief_m:
        raise UsageError(
            f"{owner}: its scales {told} put heights {z_m:.3g} m apart, more than relief_m of"
            f" {parameters.relief_m:g} m, so that slopes look level: write it again with a finer scale of z"
        )
    if side_m > COARSE * cell_m:
        log.warning("%s: its scales %s put x and y %.3g m apart: write finer ones", owner, told, side_m)
