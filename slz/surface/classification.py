"""Classification of surface cells: the probability of each kind from the evidence of all rules.

The rules are files of `slz.kernels.surface`, their sum is `slz.kernels.surface.weights_of_evidence`.
"""

from __future__ import annotations

import numpy as np

from slz.kernels.surface.surface_record import N_LAYERS
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
    before = NOTHING if shape is None else shape
    odds, labels, level_m, surface_m = weigh(fields, cell_m, before, said, sees_obliquely, out)
    # NumPy's exponential of single precision: other libraries round it otherwise.
    np.exp(odds, out=odds)
    decide(odds, fields, cell_m, labels, level_m, surface_m, KINDS, out)
    return SurfaceLayers(out)
