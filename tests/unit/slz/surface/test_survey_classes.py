"""Classes of a survey: what most points of a cell are decides, whatever its shape."""

from __future__ import annotations

import numpy as np
import pytest

from slz.surface.classification import SurveyClasses
from slz.surface.surface_kinds import SurfaceKind
from tests.unit.slz.surface.made_ground import SUSPICION, classify, lake, made

SIDE = 20
GROUND = made(lambda x, _: 0.03 * x, SIDE, 10)


def classes(building: float = 0, low: float = 0, tall: float = 0, side: int = SIDE) -> SurveyClasses:
    """Return the classes of cells with ten points each."""
    counts = (np.full((side, side), n, np.float32) for n in (building, low, tall, 10))
    return SurveyClasses(*counts)


@pytest.mark.parametrize(
    ("told", "kind"),
    [
        (classes(), SurfaceKind.BARE),
        (classes(building=8), SurfaceKind.ROOF),
        (classes(building=2), SurfaceKind.BARE),
        (classes(low=8), SurfaceKind.LOW_VEGETATION),
        (classes(tall=8), SurfaceKind.CANOPY),
        (classes(low=2, tall=6), SurfaceKind.CANOPY),
        (classes(low=6, tall=2), SurfaceKind.LOW_VEGETATION),
    ],
)
def test_a_class_of_most_points_makes_the_kind_of_plain_ground(
    told: SurveyClasses, kind: SurfaceKind
) -> None:
    assert (classify(GROUND, told).kind == kind).all()


def test_more_points_of_a_class_never_make_it_less_likely() -> None:
    roof = [classes(building=n).for_roof()[0, 0] for n in range(11)]
    plants = [classes(low=n / 2, tall=n / 2).for_plants()[0, 0] for n in range(11)]
    for score in (roof, plants):
        assert score == sorted(score)
        assert score[0] == 0
        assert score[-1] > 4


def test_the_share_of_tall_plants_is_unknown_without_plants() -> None:
    assert np.isnan(classes(building=5).tall_share()).all()
    np.testing.assert_allclose(classes(low=1, tall=3).tall_share(), 0.75)


def test_cells_without_points_have_no_classes() -> None:
    none = SurveyClasses(*(np.zeros((2, 2), np.float32) for _ in range(4)))
    assert not none.for_roof().any()
    assert not none.for_plants().any()


def test_classes_of_plants_do_not_hide_a_lake() -> None:
    water = classify(made(lake()), classes(low=8, side=80)).water
    assert water[30:50, 30:50].min() > SUSPICION
