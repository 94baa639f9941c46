"""Raised plateaus: roofs with their height over the ground, and ground that is none."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from slz.kernels.surface.raised_plateaus import raised_plateaus
from slz.surface.surface_kinds import SurfaceKind
from tests.unit.slz.surface.made_ground import (
    SUSPICION,
    Floats,
    Shape,
    SurfaceCells,
    classify,
    emptied,
    extents_of,
    made,
    places,
)

SIDE, HALF_M = 40, 8.0


def away(x: Floats, y: Floats) -> Floats:
    """Return the distance from the middle, along the farther axis."""
    return np.asarray(np.maximum(np.abs(x - SIDE / 2), np.abs(y - SIDE / 2)))


def house(height_m: float, parapet_m: float = 0.0, slope: float = 0.0) -> Shape:
    def height(x: Floats, y: Floats) -> Floats:
        roof = away(x, y) < HALF_M
        return np.asarray(slope * x + height_m * roof + parapet_m * (roof & (away(x, y) > HALF_M - 0.3)))

    return height


AWAY = away(*places(SIDE))


def raised(cells: SurfaceCells) -> NDArray[np.float32]:
    return raised_plateaus(cells.fields, cells.cell_m)[1]


ON, OFF = AWAY < HALF_M - 2, AWAY > HALF_M + 1


@pytest.mark.parametrize("height_m", [2.0, 3.0, 12.0])
@pytest.mark.parametrize(("parapet_m", "slope"), [(0, 0), (1.0, 0), (0, 0.02)])
def test_a_roof_is_told_with_its_height(height_m: float, parapet_m: float, slope: float) -> None:
    cells = made(house(height_m, parapet_m, slope), SIDE, 10, 0.02)
    (log_odds, raised_m), kind = raised_plateaus(cells.fields, 1.0), classify(cells).kind
    np.testing.assert_allclose(raised_m[ON], height_m, atol=0.1)
    assert (log_odds[ON] > 3).all()
    assert (kind[ON] == SurfaceKind.ROOF).all()
    assert not (kind[OFF] == SurfaceKind.ROOF).any()
    assert not raised_m[OFF].any()


@pytest.mark.parametrize("unseen_m", [1, 2, 3])
def test_a_roof_whose_foot_was_not_seen_is_told_with_its_height(unseen_m: int) -> None:
    foot = (AWAY > HALF_M) & (AWAY - unseen_m < HALF_M)
    cells = emptied(made(house(5.0), SIDE, 10, 0.02), foot)
    np.testing.assert_allclose(raised(cells)[ON], 5.0, atol=0.1)
    assert (classify(cells).kind[ON] == SurfaceKind.ROOF).all()


def test_a_platform_a_step_high_is_no_roof() -> None:
    assert not raised(made(house(1.2), SIDE, 10, 0.02)).any()


def test_a_block_smaller_than_a_roof_is_none() -> None:
    cells = made(lambda x, y: np.where(away(x, y) < 1, 3.0, 0), SIDE, 10, 0.02)
    assert not raised(cells).any()


def test_the_bottom_of_a_pit_is_no_roof() -> None:
    cells = made(house(-3.0), SIDE, 10, 0.02)
    assert not raised(cells)[ON].any()
    assert not (classify(cells).kind[ON] == SurfaceKind.ROOF).any()


def test_the_ground_around_a_pit_is_no_roof() -> None:
    cells = made(house(-3.0), SIDE, 10, 0.02)
    assert not (classify(cells).kind[OFF] == SurfaceKind.ROOF).any()


def test_a_terrace_joined_to_the_ground_by_a_ramp_is_no_roof() -> None:
    def height(x: Floats, y: Floats) -> Floats:
        terrace = np.where((x > 5) & (x < 15) & (y > 5) & (y < 35), 3.0, 0.0)
        ramp = (x >= 15) & (x < 30) & (np.abs(y - 20) < 4)
        return np.asarray(np.where(ramp, 3 - 0.2 * (x - 15), terrace))

    assert not raised(made(height, SIDE, 10, 0.02)).any()


def test_a_level_roof_with_a_rim_that_rises_is_no_water() -> None:
    """Its banks are parapets."""

    def height(x: Floats, y: Floats) -> Floats:
        rim = 0.06 * np.maximum(0, away(x, y) - HALF_M)
        return np.asarray(np.where(away(x, y) < HALF_M + 5, 4 + rim, 0.05 * x))

    cells = made(height, SIDE, 10)
    labels, _, log_odds = extents_of(cells)
    assert (log_odds[labels][ON] > 3).all()
    assert classify(cells).water[ON].max() <= SUSPICION
