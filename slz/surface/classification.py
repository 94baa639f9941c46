"""Classification of surface cells: the probability of each kind from the evidence of all rules.

The rules are files of `slz.kernels.surface`, their sum is `slz.kernels.surface.weights_of_evidence`.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from slz.kernels.surface.dark_returns import dark_returns
from slz.kernels.surface.level_extents import (
    FALLING_M,
    RESIDUAL_M,
    ROUGHEST_M,
    add_coarse,
    coarser,
    extents_of,
)
from slz.kernels.surface.penetration import penetration
from slz.kernels.surface.raised_plateaus import raised_plateaus
from slz.kernels.surface.smooth_planes import smooth_planes
from slz.kernels.surface.specular_returns import specular_returns
from slz.kernels.surface.surface_record import COUNT, MEAN, N_LAYERS, RAISED, SQUARES
from slz.kernels.surface.vanishing_returns import vanishing_returns
from slz.kernels.surface.weights_of_evidence import decide, weigh
from slz.surface.surface_kinds import SurfaceKind
from slz.surface.surface_probabilities import SurfaceLayers
from slz.surface.survey_classes import Floats, SurveyClasses

NOTHING, NOBODY = np.empty((0, 0), np.float32), np.empty((0, 0, 0), np.float32)
KINDS = np.array(
    [SurfaceKind.WATER, SurfaceKind.ROOF, SurfaceKind.LOW_VEGETATION, SurfaceKind.CANOPY, SurfaceKind.BARE],
    np.float32,
)


def classify(
    fields: Floats,
    cell_m: float,
    classes: SurveyClasses | None = None,
    shape: Floats | None = None,
    sees_obliquely: bool = False,
) -> SurfaceLayers:
    """Tell the kinds of surface of a box of cells.

    Parameters
    ----------
    fields
        (SURFACE_FIELDS, rows, cols) of `slz.kernels.surface.surface_record`.
    cell_m
        Side of a cell.
    classes
        What the maker of a survey said, if any.
    shape
        (rows, cols) SHAPE as told before with more of the surroundings, 0 for none.
    sees_obliquely
        Whether the sensor sees obliquely elsewhere.
    """
    said = NOBODY if classes is None else classes.scores()
    out = np.empty((N_LAYERS, *fields.shape[1:]), np.float32)
    planes = smooth_planes(fields[COUNT], fields[MEAN], fields[SQUARES], cell_m)
    labels, level_m, scores = level_extents(fields, planes, cell_m, is_far=shape is None)
    on_level = labels > 0 if shape is None else (labels > 0) | (shape != 0)
    (roofs, out[RAISED]), plants = raised_plateaus(fields, cell_m), penetration(fields)
    mirrors, surface_m = specular_returns(fields)
    lost, dark = vanishing_returns(fields, on_level, sees_obliquely), dark_returns(fields, on_level)
    told = scores.astype(np.float32)[labels], roofs, plants, mirrors, lost, dark
    odds = weigh(fields, cell_m, planes, on_level, *told, NOTHING if shape is None else shape, said, out)
    # NumPy's exponential of single precision: other libraries round it otherwise.
    np.exp(odds, out=odds)
    decide(odds, fields, cell_m, labels, level_m, surface_m, KINDS, out)
    return SurfaceLayers(out)


def level_extents(
    fields: Floats, planes: Floats, cell_m: float, is_far: bool
) -> tuple[NDArray[np.int32], Floats, NDArray[np.float64]]:
    """Return labels and level of level extents, and the log odds of each label; far, of wide cells too."""
    labels, level_m, scores, _ = extents_of(
        fields[COUNT], fields[MEAN], planes, cell_m, RESIDUAL_M, FALLING_M
    )
    if not is_far:
        return labels, level_m, scores
    count, mean, squares = coarser(fields)
    wide_planes = smooth_planes(count, mean, squares, 2 * cell_m)
    wide = extents_of(count, mean, wide_planes, 2 * cell_m, ROUGHEST_M, np.inf)
    if wide[2].any():
        scores = add_coarse(fields, labels, level_m, scores, *wide)
    return labels, level_m, scores
