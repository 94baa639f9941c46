"""Classification of surface cells: the probability of each kind from the evidence of all rules.

The rules are files of `slz.kernels.surface`, their sum is `slz.kernels.surface.weights_of_evidence`.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from params import Parameters
from slz.kernels.surface.level_extents import (
    FALLING_M,
    RESIDUAL_M,
    ROUGHEST_M,
    add_coarse,
    coarser,
    extents_of,
)
from slz.kernels.surface.raised_plateaus import penetration, raised_plateaus
from slz.kernels.surface.smooth_planes import smooth_planes
from slz.kernels.surface.surface_record import (
    CANOPY,
    COUNT,
    KIND,
    LOW_VEGETATION,
    MEAN,
    N_LAYERS,
    RAISED,
    ROOF,
    SQUARES,
    WATER,
)
from slz.kernels.surface.water_returns import dark_returns, specular_returns, vanishing_returns
from slz.kernels.surface.weights_of_evidence import decide, weigh
from slz.surface.surface_kinds import UNKNOWN_SURFACE, SurfaceHere, SurfaceKind

Floats = NDArray[np.float32]
SHARE = 0.5  # of a cell's points, from which on their class is that of the cell
SCORE = 6.0  # log odds
PROBABLE = {
    SurfaceKind.WATER: WATER,
    SurfaceKind.ROOF: ROOF,
    SurfaceKind.LOW_VEGETATION: LOW_VEGETATION,
    SurfaceKind.CANOPY: CANOPY,
}
NOTHING, NOBODY = np.empty((0, 0), np.float32), np.empty((0, 0, 0), np.float32)
KINDS = np.array(
    [SurfaceKind.WATER, SurfaceKind.ROOF, SurfaceKind.LOW_VEGETATION, SurfaceKind.CANOPY, SurfaceKind.BARE],
    np.float32,
)


@dataclass(frozen=True, slots=True)
class SurveyClasses:
    """Number of points of a cell by class, (rows, cols) each.

    building: class 6. low_plant: 3. tall_plant: 4 and 5. total: all points.
    """

    building: Floats
    low_plant: Floats
    tall_plant: Floats
    total: Floats

    def scores(self) -> Floats:
        """Return the log odds for a roof and for plants, and the share of tall ones, (3, rows, cols)."""
        return np.stack([self.for_roof(), self.for_plants(), self.tall_share()])

    def for_roof(self) -> Floats:
        """Return the log odds for a roof."""
        return self._score(self.building)

    def for_plants(self) -> Floats:
        """Return the log odds for plants."""
        return self._score(self.low_plant + self.tall_plant)

    def tall_share(self) -> Floats:
        """Return the share of tall ones among the plants, NaN where no point is a plant."""
        with np.errstate(invalid="ignore"):
            return np.asarray(self.tall_plant / (self.low_plant + self.tall_plant), np.float32)

    def _score(self, count: Floats) -> Floats:
        share = count / np.maximum(self.total, 1)
        return np.asarray(SCORE * np.clip(share / SHARE, 0, 1), np.float32)


def refused_kinds(parameters: Parameters) -> NDArray[np.bool_]:
    """Return whether the profile refuses to land on each `SurfaceKind`, whatever its shape."""
    rules = {SurfaceKind.ROOF: parameters.roof, SurfaceKind.LOW_VEGETATION: parameters.vegetation}
    return np.array([rules.get(kind) == "refuse" for kind in SurfaceKind])


@dataclass(frozen=True, slots=True)
class SurfaceLayers:
    """Surface layers of a box of cells.

    values: (N_LAYERS, rows, cols) float32 of `slz.kernels.surface.surface_record`.
    """

    values: NDArray[np.float32]

    @property
    def water(self) -> NDArray[np.float32]:
        """Probability of water."""
        return np.asarray(self.values[WATER])

    @property
    def kind(self) -> NDArray[np.uint8]:
        """Likeliest kind of each cell."""
        return np.asarray(self.values[KIND].astype(np.uint8))

    def refused(self, parameters: Parameters) -> NDArray[np.bool_]:
        """Return the cells on which no vehicle may land: water may be there, or what the profile refuses."""
        return np.asarray((self.water > parameters.water_suspicion) | refused_kinds(parameters)[self.kind])

    def here(self) -> SurfaceHere:
        """Return what the box is as a whole: its most frequent kind, and its worst suspicion of water."""
        kinds = self.kind.ravel()
        known = kinds[kinds != SurfaceKind.UNKNOWN]
        if not len(known):
            water = float(self.water.max(initial=0.0))
            return SurfaceHere(water=water) if water > 0 else UNKNOWN_SURFACE
        kind = SurfaceKind(int(np.bincount(known).argmax()))
        own = self.kind == kind
        at = PROBABLE.get(kind)
        sure = self.values[at][own] if at is not None else 1 - self.values[:RAISED].sum(axis=0)[own]
        raised_m = float(np.median(self.values[RAISED][own])) if kind is SurfaceKind.ROOF else 0.0
        return SurfaceHere(kind, float(sure.mean()), float(self.water.max()), raised_m)


def classify(
    fields: Floats,
    cell_m: float,
    classes: SurveyClasses | None = None,
    shape: Floats | None = None,
    sees_obliquely: bool = False,
) -> SurfaceLayers:
    """Classify the surface of a box of cells.

    Parameters
    ----------
    fields
        (SURFACE_FIELDS, rows, cols) of `slz.kernels.surface.surface_record`.
    cell_m
        Side of a cell.
    classes
        What the maker of a survey said, if any.
    shape
        (rows, cols) SHAPE from an earlier look with more of the surroundings, 0 for none.
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
    evidence = scores.astype(np.float32)[labels], roofs, plants, mirrors, lost, dark
    odds = weigh(fields, cell_m, planes, on_level, *evidence, NOTHING if shape is None else shape, said, out)
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
