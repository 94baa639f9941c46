"""What the ground at a place is: words, confirmation, and boxes of layers as a whole."""

from __future__ import annotations

import math

import numpy as np
import pytest
from numpy.typing import NDArray

import params
from slz.kernels.surface.surface_record import CANOPY, KIND, LOW_VEGETATION, N_LAYERS, RAISED, ROOF, WATER
from slz.surface.classification import SurfaceLayers
from slz.surface.surface_kinds import SurfaceHere, SurfaceKind

Flags = NDArray[np.bool_]


@pytest.mark.parametrize(
    ("here", "text"),
    [
        (SurfaceHere(), "unknown"),
        (SurfaceHere(SurfaceKind.WATER, 0.9), "water"),
        (SurfaceHere(SurfaceKind.ROOF, 0.9, 0.0, 12.4), "roof, 12 m up"),
        (SurfaceHere(SurfaceKind.ROOF, 0.9), "roof"),
        (SurfaceHere(SurfaceKind.BARE, 0.9, 0.0, 3.0), "bare ground"),
    ],
)
def test_a_surface_is_told_in_words(here: SurfaceHere, text: str) -> None:
    assert here.text == text


@pytest.mark.parametrize("kind", SurfaceKind)
@pytest.mark.parametrize("roof", ["allow", "confirm", "refuse"])
@pytest.mark.parametrize("vegetation", ["allow", "confirm", "refuse"])
def test_roofs_and_low_vegetation_are_confirmed_unless_they_are_allowed(
    kind: SurfaceKind, roof: str, vegetation: str
) -> None:
    asked = {SurfaceKind.ROOF: roof != "allow", SurfaceKind.LOW_VEGETATION: vegetation != "allow"}
    assert SurfaceHere(kind, 0.9).must_be_confirmed(roof, vegetation) is asked.get(kind, False)


def layers() -> SurfaceLayers:
    """Return a row each of unknown, bare, roof, low vegetation and canopy, with some suspicion of water."""
    values = np.zeros((N_LAYERS, 5, 4), np.float32)
    kinds = [0, SurfaceKind.BARE, SurfaceKind.ROOF, SurfaceKind.LOW_VEGETATION, SurfaceKind.CANOPY]
    values[KIND] = np.array(kinds)[:, np.newaxis]
    values[ROOF, 2], values[LOW_VEGETATION, 3], values[CANOPY, 4] = 0.8, 0.7, 0.6
    values[RAISED, 2] = [3, 4, 5, 50]
    values[WATER, 1] = [0.0, 0.04, 0.06, 0.2]
    return SurfaceLayers(values)


def refused(*settings: str) -> Flags:
    return layers().refused(params.load("quadcopter", list(settings)))


def test_ground_is_refused_where_water_is_suspected() -> None:
    assert np.argwhere(refused()).tolist() == [[1, 2], [1, 3]]
    assert np.argwhere(refused("water_suspicion=0.1")).tolist() == [[1, 3]]
    assert not refused("water_suspicion=1").any()


@pytest.mark.parametrize(("rule", "row"), [("roof", 2), ("vegetation", 3)])
def test_roofs_and_low_vegetation_are_refused_by_the_profile_s_rule(rule: str, row: int) -> None:
    for word in ("allow", "confirm"):
        assert not refused(f"{rule}={word}")[row].any()
    strict = refused(f"{rule}=refuse")
    assert strict[row].all()
    assert np.count_nonzero(strict) == 4 + 2


def part(*rows: int) -> SurfaceHere:
    return SurfaceLayers(layers().values[:, rows]).here()


def test_a_box_is_of_its_most_frequent_known_kind_with_its_worst_suspicion_of_water() -> None:
    here = part(0, 0, 1)
    assert here.kind is SurfaceKind.BARE
    assert here.water == pytest.approx(0.2)
    assert here.probability == pytest.approx(1 - 0.3 / 4)
    assert part(1, 2, 2).water == pytest.approx(0.2)


def test_a_box_on_a_roof_tells_its_median_height() -> None:
    here = part(2, 2, 1)
    assert here.kind is SurfaceKind.ROOF
    assert (here.probability, here.water) == pytest.approx((0.8, 0.2))
    assert here.raised_m == 4.5


@pytest.mark.parametrize(("row", "probability"), [(3, 0.7), (4, 0.6)])
def test_a_box_of_plants_is_as_probable_as_its_cells(row: int, probability: float) -> None:
    here = part(row)
    assert here.probability == pytest.approx(probability)
    assert here.raised_m == 0


def test_a_box_of_no_likely_kind_tells_its_suspicion_of_water_as_well() -> None:
    values = np.zeros((N_LAYERS, 3, 3), np.float32)
    values[WATER] = 0.3
    assert SurfaceLayers(values).here().water == pytest.approx(0.3)


def test_a_box_of_which_nothing_is_known_is_unknown() -> None:
    here = part(0)
    assert here.kind is SurfaceKind.UNKNOWN
    assert math.isnan(here.probability)
