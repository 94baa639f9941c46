"""Penetration: crops and trees let light pass to several depths, rocks and hard ground do not."""

from __future__ import annotations

import numpy as np
import pytest

from slz.kernels.surface.raised_plateaus import penetration
from slz.kernels.surface.surface_record import NUMBERED, SEVERAL
from slz.surface.surface_kinds import SurfaceKind
from tests.unit.slz.surface.made_ground import (
    Floats,
    SurfaceCells,
    cells_of,
    classify,
    made,
    returns_of,
    with_fields,
)

SIDE = 24


def plants(top_m: float, scale_m: float, per_m2: float = 20) -> SurfaceCells:
    """Return plants in which rays come to exponential depths, down to the ground."""
    points = returns_of(lambda x, _: top_m + 0 * x, SIDE, per_m2, 0.02)
    points[:, 2] -= np.minimum(np.random.default_rng(2).exponential(scale_m, len(points)), top_m)
    return cells_of(points, SIDE, SIDE)


def flat(per_m2: float = 20, strays: float = 0.0) -> SurfaceCells:
    """Return hard ground of whose returns a share is a metre too high or too low."""
    points, rng = returns_of(lambda x, _: 0 * x, SIDE, per_m2, 0.02), np.random.default_rng(3)
    astray = rng.random(len(points)) < strays
    points[astray, 2] += rng.choice([-1.0, 1.0], np.count_nonzero(astray))
    return cells_of(points, SIDE, SIDE)


def rocks(n: int) -> SurfaceCells:
    rng = np.random.default_rng(5)
    at, half, top = rng.uniform(0, SIDE, (n, 2)), rng.uniform(0.3, 0.8, n), rng.uniform(0.2, 1.0, n)

    def height(x: Floats, y: Floats) -> Floats:
        out = np.zeros(len(x))
        for (east, north), side, up in zip(at, half, top, strict=True):
            out = np.maximum(out, up * ((np.abs(x - east) < side) & (np.abs(y - north) < side)))
        return out

    return made(height, SIDE, 20, 0.02)


@pytest.mark.parametrize("per_m2", [8, 20])
def test_a_crop_is_low_vegetation(per_m2: float) -> None:
    cells = plants(0.8, 0.3, per_m2)
    assert (penetration(cells.fields) > 2).all()
    assert (classify(cells).kind == SurfaceKind.LOW_VEGETATION).mean() > 0.99


def test_trees_are_canopy() -> None:
    cells = plants(8.0, 2.0)
    kind = classify(cells).kind
    assert (kind == SurfaceKind.CANOPY).mean() > 0.95


@pytest.mark.parametrize(("per_m2", "strays"), [(20, 0.0), (20, 1e-3), (300, 3e-3)])
def test_hard_ground_with_a_few_false_returns_is_bare(per_m2: float, strays: float) -> None:
    cells = flat(per_m2, strays)
    assert (penetration(cells.fields) < -2).all()
    assert (classify(cells).kind == SurfaceKind.BARE).all()


@pytest.mark.parametrize("slope", [0.1, 0.25])
def test_a_slope_is_no_plant(slope: float) -> None:
    cells = made(lambda x, _: slope * x, SIDE, 20, 0.02)
    assert not (penetration(cells.fields) > 0).any()


def test_a_field_of_rocks_is_bare_for_the_most_part() -> None:
    kind = classify(rocks(40)).kind
    assert (kind == SurfaceKind.BARE).mean() > 0.9
    assert not (kind == SurfaceKind.CANOPY).any()


def test_few_returns_tell_no_plants() -> None:
    sparse = plants(0.8, 0.3, 0.8)
    assert (penetration(sparse.fields) <= -4).all()


def test_rays_with_several_returns_speak_for_plants_and_rays_with_one_against_nothing() -> None:
    cells = flat()
    before = penetration(cells.fields)
    one = penetration(with_fields(cells, {NUMBERED: 20.0}).fields)
    many = penetration(with_fields(cells, {NUMBERED: 20.0, SEVERAL: 5.0}).fields)
    np.testing.assert_array_equal(one, before)
    assert (many >= before + 2.9).all()
