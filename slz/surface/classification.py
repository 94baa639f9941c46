"""Classification of surface cells: the probability of each kind from the evidence of all rules."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from slz.kernels.surface.neighbourhood import box_sums
from slz.kernels.surface.surface_record import DARK, LOST_NEAR
from slz.surface.dark_returns import dark_returns
from slz.surface.flooded_ground import SEED, with_flooded_ground
from slz.surface.level_extents import fine_extents, level_extents
from slz.surface.penetration import DEPTH_M, penetration
from slz.surface.raised_plateaus import raised_plateaus
from slz.surface.specular_returns import SpecularReturns, specular_returns
from slz.surface.surface_cells import Flags, Floats, SurfaceCells
from slz.surface.surface_kinds import SurfaceKind
from slz.surface.surface_probabilities import SurfaceLayers
from slz.surface.survey_classes import SurveyClasses
from slz.surface.vanishing_returns import FEWEST_RAYS, vanishing_returns

BESIDE, SHORE = 3, 0.1  # cells around; probability that a footprint in a cell beside water reaches it
SCORE_WATER = -4.7  # log odds of water before any evidence
MOST_ACQUITTAL = -0.5  # log odds, of an extent over which returns vanish
FEWEST_BRIGHT, SCORE_BRIGHT = (
    6.0,
    1.5,
)  # bright oblique returns more than dark ones, and what lost rays say then
SCORE_BOTH = 2.0  # log odds more, where returns vanish and those left are darker than any dry ground
# Water has no gradient; ground whose plane is clean has the one told. An attitude that errs tilts water by
# 1.3 degrees (PX4), so where near rays surely vanish the ground must slope by more.
GRADIENTS, SCORES_SLOPING = (0.004, 0.01, 0.02), (0.0, -3.5, -5.0)
TILTED, SCORES_TILTED = (0.025, 0.045, 0.07), (0.0, -3.4, -5.0)
WINDOW, SIGMAS = 1.4, 2.5  # standard deviation of places in a plane's window, in cells; standard errors
CLEAN_M = 0.05  # residual of the plane of such ground, without a bank in it
FEWEST_RETURNS = 8.0  # in the window of a plane, to tell a kind
LIKELIEST = np.array(
    [SurfaceKind.WATER, SurfaceKind.ROOF, SurfaceKind.LOW_VEGETATION, SurfaceKind.CANOPY, SurfaceKind.BARE]
)


def classify(
    cells: SurfaceCells,
    classes: SurveyClasses | None = None,
    shape: Floats | None = None,
    sees_obliquely: bool = False,
) -> SurfaceLayers:
    """Tell the kinds of surface of a box of cells.

    Parameters
    ----------
    classes
        What the maker of a survey said, if any.
    shape
        (rows, cols) SHAPE as told before with more of the surroundings, 0 for none.
    sees_obliquely
        Whether the sensor sees obliquely elsewhere.
    """
    extents = level_extents(cells) if shape is None else fine_extents(cells)
    plateaus, plants = raised_plateaus(cells), penetration(cells)
    on_level = extents.labels > 0 if shape is None else (extents.labels > 0) | (shape != 0)
    mirror = specular_returns(cells)
    vanishing, sure = _vanishing(cells, on_level, mirror, sees_obliquely)
    # Around a strip of water that answered lies more of it, as even as ground: shape acquits it of little.
    level = extents.evidence()
    if shape is not None:
        level = np.where(shape != 0, np.maximum(level, shape), level)
    level = np.where(plateaus.log_odds > 0, np.minimum(level, 0), level)  # its banks are parapets
    log_odds = SCORE_WATER + np.where(vanishing > 0, np.maximum(level, MOST_ACQUITTAL), level) + vanishing
    # At its shore the window of a plane holds the bank, and below a mirror it may show the bottom.
    log_odds += np.where((level > 0) | (mirror.log_odds > 0), 0, _sloping(cells, sure))
    there = cells.seen | on_level
    water = with_flooded_ground(np.where(there, _probability(log_odds), 0), cells, extents, mirror)
    # A shore passes through cells of which at least three others are water.
    beside = box_sums((water >= SEED).astype(np.float32)[np.newaxis], 1)[0] > BESIDE - 0.5
    water = np.where(beside & cells.seen, np.maximum(water, SHORE), water)
    for_plants, for_roof = plants.log_odds, plateaus.log_odds
    tall = np.clip((plants.depth_m - DEPTH_M) / 0.5 + 0.5, 0, 1)
    if classes is not None:
        for_plants, for_roof = for_plants + classes.for_plants(), for_roof + classes.for_roof()
        said = classes.tall_share()
        tall = np.where(np.isnan(said), tall, said)
    plant = np.where(cells.seen, _probability(for_plants), 0) * (1 - water)
    roof = np.where(cells.seen, _probability(for_roof), 0) * (1 - water - plant)
    parts = np.stack([water, roof, plant * (1 - tall), plant * tall])
    bare = np.where(cells.seen & (cells.n_around >= FEWEST_RETURNS), 1 - parts.sum(axis=0), 0)
    likelihood = np.concatenate([parts, bare[np.newaxis]])
    kind = np.where(likelihood.max(axis=0) > 0.5, LIKELIEST[likelihood.argmax(axis=0)], SurfaceKind.UNKNOWN)
    return SurfaceLayers(np.stack([*parts, plateaus.raised_m, kind, level]).astype(np.float32))


def _vanishing(
    cells: SurfaceCells, on_level: Flags, mirror: SpecularReturns, sees_obliquely: bool
) -> tuple[Floats, Flags]:
    """Return what lost, dark and specular returns together say for water, and where they surely say so.

    The three have one cause, so the strongest counts; darkness beside lost rays counts a little more.
    """
    lost, dark = vanishing_returns(cells, on_level, sees_obliquely), dark_returns(cells, on_level)
    bright = cells.fields[DARK] <= -FEWEST_BRIGHT
    score = np.where(bright, np.minimum(lost, SCORE_BRIGHT), lost)
    both = np.where((dark > 0) & (score > 0), np.float32(SCORE_BOTH), np.float32(0))
    score = np.where(dark > 0, np.maximum(score, dark) + both, score)
    score = np.where(mirror.log_odds > 0, np.maximum(score, mirror.log_odds), score)
    near = (cells.fields[LOST_NEAR] >= FEWEST_RAYS) | (dark > 0)
    return score, near & (score > 0)


def _sloping(cells: SurfaceCells, watery: Flags) -> Floats:
    """Return the log odds for water from the gradient of the ground, as far as noise does not explain it."""
    with np.errstate(invalid="ignore"):
        clean = cells.residual_m < CLEAN_M
    score = np.zeros(cells.shape, np.float32)
    error = cells.residual_m[clean] / np.sqrt(cells.n_around[clean]) / (WINDOW * cells.cell_m)
    sure = cells.gradient[clean] - SIGMAS * error
    by_tilt = np.interp(sure, TILTED, SCORES_TILTED)
    score[clean] = np.where(watery[clean], by_tilt, np.interp(sure, GRADIENTS, SCORES_SLOPING))
    return score


def _probability(log_odds: NDArray[np.floating]) -> Floats:
    return np.asarray(1 / (1 + np.exp(-np.clip(log_odds, -30, 30))), np.float32)
