"""Specular returns: a mirror from above over a dim bottom is water; wet tarmac and plants are none."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from slz.kernels.surface.surface_record import ASIDE, ASIDE_LIGHT, ASIDE_M, MEAN, NADIR, NADIR_LIGHT, NADIR_M
from slz.kernels.surface.water_returns import BRIGHTER, BRIGHTEST, specular_returns
from tests.unit.slz.surface.made_ground import (
    SUSPICION,
    SurfaceCells,
    classify,
    from_middle,
    made,
    places,
    with_fields,
)

SIDE = 60
MIDDLE = np.zeros((SIDE, SIDE), bool)
MIDDLE[26:34, 20:40] = True


def soil(per_m2: float = 4.0) -> SurfaceCells:
    """Return bare ground that slopes by a hundredth and is a little uneven."""
    return made(lambda x, y: 0.01 * x + 0.05 * np.sin(x / 3) * np.sin(y / 4), SIDE, per_m2)


def seen(
    cells: SurfaceCells, ratio: float, drop_m: float, n: int = 6, where: NDArray[np.bool_] = MIDDLE
) -> SurfaceCells:
    """Return cells seen from above and from aside, as bright and as much lower from aside as told."""
    level = cells.fields[MEAN]
    fields = {
        NADIR: n, NADIR_M: level + drop_m / 2, NADIR_LIGHT: 0.04 * ratio,
        ASIDE: n, ASIDE_M: level - drop_m / 2, ASIDE_LIGHT: 0.04,
    }  # fmt: skip
    return with_fields(cells, {k: np.where(where, v, 0) for k, v in fields.items()})


@pytest.mark.parametrize(
    ("ratio", "drop_m", "water"),
    [
        (1.05, 0.0, False),  # dry ground
        (1.0, -0.05, False),  # plants: rays from above go deeper
        (1.05, 0.1, False),  # a step, or an attitude that errs
        (0.9 * BRIGHTEST, 0.0, False),  # wet tarmac
        (0.9 * BRIGHTEST, -0.1, False),
        (1.1 * BRIGHTER, 0.08, True),  # the bottom of shallow water
        (1.1 * BRIGHTEST, 0.0, True),  # deep or still water
    ],
)
def test_water_shines_from_above_and_lies_lower_from_aside(ratio: float, drop_m: float, water: bool) -> None:
    told = specular_returns(seen(soil(), ratio, drop_m).fields)[0]
    assert (told[28:32, 24:36] > 0).all() == water
    assert (told > 0).any() == water


@pytest.mark.parametrize("field", [NADIR, ASIDE])
def test_a_surface_seen_from_one_side_only_tells_nothing(field: int) -> None:
    assert not specular_returns(with_fields(seen(soil(), 20, 0.1), {field: 0}).fields)[0].any()


def test_few_returns_tell_nothing() -> None:
    one = np.zeros_like(MIDDLE)
    one[30, 30] = True
    assert not specular_returns(seen(soil(), 20, 0.1, n=2, where=one).fields)[0].any()


def test_the_ground_lower_than_a_mirror_is_flooded_and_the_higher_is_not() -> None:
    x, y = places(SIDE)
    away = from_middle(x, y, 30.0)
    basin = made(lambda x, y: 0.02 * np.maximum(from_middle(x, y, 30.0) - 15, -5) + 0.1, SIDE)
    level = with_fields(seen(basin, 10, 0.1), {NADIR_M: np.where(MIDDLE, 0.1, 0)})
    water = classify(level).water
    assert (water[away < 13] > SUSPICION).all()
    assert (water[away > 20] <= SUSPICION).all()


def test_cells_beside_a_mirror_that_were_not_seen_from_above_say_nothing_of_its_level() -> None:
    """A height of 0 m is above the water, and above the meadow beside it."""
    channel = made(lambda x, y: np.where(np.abs(y - 30) < 4, -0.5, -0.2), SIDE)
    water = classify(with_fields(seen(channel, 10, 0.1), {NADIR_M: np.where(MIDDLE, -0.45, 0)})).water
    assert (water[28:32, 24:36] > SUSPICION).all()
    assert (water[2:20] <= SUSPICION).all()


def test_a_mirror_that_slopes_floods_nothing() -> None:
    x, _ = places(SIDE)
    slope = made(lambda x, y: 0.05 * x + 0 * y, SIDE, per_m2=16)
    water = classify(with_fields(seen(slope, 10, 0.1), {NADIR_M: np.where(MIDDLE, 0.05 * x, 0)})).water
    assert (water[:, 2:16] <= SUSPICION).all()
    assert (water[28:32, 24:36] > SUSPICION).all()
