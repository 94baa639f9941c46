"""Returns that vanish with incidence: shares of answered rays, and whose rays tell of a cell."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from slz.kernels.surface.surface_record import LOST_OBLIQUE, LOST_SLANTED, OBLIQUE, REPORTED, SLANTED
from slz.kernels.surface.water_returns import vanishing_returns
from tests.unit.slz.surface.made_ground import SurfaceCells, extents_of, made, places, with_fields

SIDE = 24
MIDDLE = SIDE // 2, SIDE // 2
SLOPE = made(lambda x, _: 0.05 * x, SIDE)
LEVEL = made(lambda x, _: 0 * x, SIDE)
BLOCK = np.maximum(*(np.abs(at - SIDE / 2) for at in places(SIDE))) < 3


def scores(cells: SurfaceCells, **rays: float | NDArray[Any]) -> NDArray[np.float32]:
    """Return the log odds of cells with these rays, all lost ones told by the driver."""
    names = {
        "oblique": OBLIQUE, "slanted": SLANTED, "lost_oblique": LOST_OBLIQUE,
        "lost_slanted": LOST_SLANTED, "reported": REPORTED,
    }  # fmt: skip
    lost = sum(np.asarray(rays.get(name, 0), np.float64) for name in ("lost_oblique", "lost_slanted"))
    rays.setdefault("reported", np.asarray(lost))
    cells = with_fields(cells, {names[name]: value for name, value in rays.items()})
    return vanishing_returns(cells.fields, extents_of(cells)[0] > 0, False)


def test_without_any_ray_nothing_is_told() -> None:
    assert not scores(SLOPE).any()


def test_the_fewer_oblique_rays_are_answered_the_more_it_is_water() -> None:
    told = [scores(SLOPE, oblique=n, lost_oblique=20 - n)[MIDDLE] for n in range(21)]
    assert told == sorted(told, reverse=True)
    assert told[0] > 4
    assert told[20] < -5


def test_dry_ground_that_answers_slanted_rays_is_not_acquitted_by_them() -> None:
    """Water in wind answers them as well."""
    assert not scores(SLOPE, slanted=50).any()
    assert scores(SLOPE, slanted=10, lost_slanted=40)[MIDDLE] > 3


def test_a_ray_or_two_may_be_lost_by_chance() -> None:
    one = np.zeros((SIDE, SIDE))
    one[MIDDLE] = 1
    assert not scores(SLOPE, oblique=one, lost_oblique=30 * one, reported=2 * one).any()
    assert scores(SLOPE, oblique=one, lost_oblique=30 * one, reported=3 * one)[MIDDLE] > 4


def test_lost_rays_of_the_neighbours_make_a_cell_with_few_rays_suspect() -> None:
    told = scores(SLOPE, lost_oblique=np.where(BLOCK, 3.0, 0.0))
    assert (told[BLOCK] > 4).all()
    assert told[2, 2] == 0


def test_answered_rays_of_the_neighbours_do_not_make_a_pond_dry() -> None:
    assert not scores(SLOPE, oblique=np.where(BLOCK, 0.0, 20.0))[BLOCK].any()


def test_answered_rays_on_the_same_level_extent_make_it_dry() -> None:
    told = scores(LEVEL, oblique=np.where(BLOCK, 0.0, 20.0))
    assert (told[BLOCK] < -5).all()


def test_a_cell_s_own_rays_decide_over_those_around() -> None:
    told = scores(SLOPE, oblique=np.where(BLOCK, 20.0, 0), lost_oblique=np.where(BLOCK, 0.0, 20.0))
    assert (told[BLOCK] < -5).all()
    assert (told[~BLOCK] > 4).all()


@pytest.mark.parametrize("seed", range(4))
def test_where_every_cell_has_rays_enough_the_score_is_that_of_its_shares(seed: int) -> None:
    rng = np.random.default_rng(seed)
    answered, lost = rng.integers(0, 30, (SIDE, SIDE)), rng.integers(4, 30, (SIDE, SIDE))
    told = scores(SLOPE, oblique=answered, lost_oblique=lost)
    expected = np.interp(answered / (answered + lost), (0.1, 0.2, 0.75, 1.0), (4.5, 2.5, -3.0, -6.0))
    np.testing.assert_allclose(told, expected, rtol=1e-5, atol=1e-5)


def test_one_more_lost_ray_does_not_clear_a_cell_amid_lost_ones() -> None:
    amid = np.zeros((SIDE, SIDE))
    amid[MIDDLE] = 1
    lost = np.where(BLOCK, 3.0, 0.0) * (1 - amid)
    before = scores(SLOPE, oblique=3 * amid, lost_oblique=lost)
    after = scores(SLOPE, oblique=3 * amid, lost_oblique=lost + amid, reported=np.where(BLOCK, 3.0, 0))
    assert after[MIDDLE] >= before[MIDDLE] > 2


DENSE, DENSE_SLOPE = (made(shape, SIDE, 12) for shape in (lambda x, _: 0 * x, lambda x, _: 0.05 * x))
CORE = np.maximum(*(np.abs(at - SIDE / 2) for at in places(SIDE))) < 1


@pytest.mark.parametrize(
    ("cells", "seen", "told"), [(DENSE, True, True), (DENSE, False, False), (DENSE_SLOPE, True, False)]
)
def test_level_ground_seen_from_above_alone_by_a_sensor_that_sees_obliquely_is_suspect(
    cells: SurfaceCells, seen: bool, told: bool
) -> None:
    """Where the sensor reports no lost rays, so that their absence is all that tells."""
    level = extents_of(cells)[0] > 0
    score = vanishing_returns(with_fields(cells, {OBLIQUE: 20 * ~BLOCK}).fields, level, seen)
    assert (score[CORE] > 0).all() == told
    assert not (score[~BLOCK] > 0).any()


def test_an_answered_oblique_ray_near_by_acquits_it() -> None:
    level = extents_of(DENSE)[0] > 0
    one = np.zeros((SIDE, SIDE))
    one[MIDDLE] = 1
    assert vanishing_returns(with_fields(DENSE, {OBLIQUE: one}).fields, level, True)[MIDDLE] <= 0
