"""Flooded ground: the bottom that shows through shallow water is under that water."""

from __future__ import annotations

import numpy as np
import pytest

from slz.kernels.surface.flooded_ground import BRIGHTEST_BOTTOM, flood_ground
from slz.kernels.surface.surface_record import ASIDE, ASIDE_LIGHT
from tests.unit.slz.surface.made_ground import (
    Flags,
    Floats,
    SurfaceCells,
    extents_of,
    from_middle,
    lake,
    made,
    places,
    with_fields,
)

DISTANCE = from_middle(*places(80))
LAKE = DISTANCE < 13
LITTLE = LAKE & (np.arange(80) > 40) & (np.arange(80) == 40)[:, np.newaxis]  # a row up to the shallows
SHALLOWS = (DISTANCE > 14) & (DISTANCE < 16)


def basin(depth_m: float) -> SurfaceCells:
    """Return a lake whose bottom shows in a ring of shallows, up to a bank of half a metre."""

    def height(x: Floats, y: Floats) -> Floats:
        away = from_middle(x, y)
        ring = (away > 12) & (away < 17)
        return np.asarray(np.where(ring, -depth_m, np.where(away < 17, 0, lake(17, 0.2)(x, y) + 0.3)))

    return made(height)


def flooded(cells: SurfaceCells, probability: float = 0.7, known: Flags = LAKE) -> Floats:
    """Return the probabilities of water around a lake of which some cells are known as water."""
    return with_floods(np.where(known, probability, 0.01), cells)


def with_floods(water: Floats, cells: SurfaceCells) -> Floats:
    """Return the probabilities of water with flooded ground, without a mirror."""
    (labels, level_m, _), out = extents_of(cells), water.copy()
    none = np.full(cells.shape, np.nan, np.float32)
    assert flood_ground(out, cells.fields, labels, level_m, none, 1.0) or (out == water).all()
    return out


@pytest.mark.parametrize("depth_m", [0.1, 0.3])
def test_the_bottom_beside_standing_water_is_as_probably_water(depth_m: float) -> None:
    cells = basin(depth_m)
    out = flooded(cells)
    np.testing.assert_allclose(out[SHALLOWS & cells.seen], 0.7, rtol=1e-5)
    assert out[DISTANCE > 19].max() < 0.02


def test_what_a_river_floods_falls_with_it() -> None:
    """Shallows beside a river lie lower than its water there, land far downstream is lower but dry."""
    x, y = places(120)
    away = np.abs(x - 40)

    def height(x: Floats, y: Floats) -> Floats:
        shallow = (x > 46) & (x < 50)
        return np.asarray(
            -0.004 * y + np.where(shallow, -0.15, np.clip((np.abs(x - 40) - 8) / 2, 0, 1) * 0.2)
        )

    cells = made(height, 120)
    out = flooded(cells, 0.7, (away < 5) & (y > 5) & (y < 115))
    shallows = (x > 47) & (x < 49) & (y > 5) & (y < 115)
    assert out[shallows & cells.seen].min() > 0.69
    assert out[away > 14].max() < 0.02


def test_ground_deeper_than_light_reaches_is_a_drop() -> None:
    assert flooded(basin(0.6))[SHALLOWS].max() < 0.02


def test_ground_above_the_water_is_not_flooded() -> None:
    assert flooded(basin(-0.1))[SHALLOWS].max() < 0.02


@pytest.mark.parametrize(("probability", "known"), [(0.1, LAKE), (0.7, LITTLE)])
def test_improbable_or_little_water_floods_nothing(probability: float, known: Flags) -> None:
    assert flooded(basin(0.2), probability, known)[SHALLOWS].max() < 0.02


@pytest.mark.parametrize(
    ("light", "dry"), [(BRIGHTEST_BOTTOM + 0.05, True), (BRIGHTEST_BOTTOM - 0.05, False)]
)
def test_ground_brighter_than_any_bottom_is_not_under_water(light: float, dry: bool) -> None:
    cells = with_fields(basin(0.2), {ASIDE: 5, ASIDE_LIGHT: light})
    assert (flooded(cells)[SHALLOWS & cells.seen] < 0.02).all() == dry


def test_flooding_never_makes_ground_drier() -> None:
    cells = basin(0.2)
    water = np.random.default_rng(1).random(cells.shape)
    assert (with_floods(water, cells) >= water).all()
