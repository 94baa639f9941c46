"""What the sources say of their scenes holds on ours (SLZ paper §4, SLZ thesis §4)."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from companion.evaluation import zone_mask
from companion.reproduce.scenes import PAPER_AREA_ERROR, STADIUM_AT_1_M, Case, Outcome, run
from slz import SAFE, Zone

SURVEY = replace(STADIUM_AT_1_M, extent_m=(-120.0, -80.0, 200.0, 110.0))
SOURCE = Case("source", SURVEY, PAPER_AREA_ERROR, "helicopter", ("mode=source",))
UNFILTERED = Case(
    "unfiltered", SURVEY, 1.0, "helicopter", ("mode=source", "min_square_m=6", "min_boundary_points=20")
)
DEFAULT = Case("default", SURVEY, 0.1, "helicopter", ("mode=default", "coverage_m=3", "footprint_m=3"))


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("surveys")


@pytest.fixture(scope="module")
def source(folder: Path) -> Outcome:
    return run(SOURCE, folder)[0]


@pytest.fixture(scope="module")
def default(folder: Path) -> Outcome:
    return run(DEFAULT, folder)[0]


def inner(outcome: Outcome, region: str, margin_m: float, across_m: float | None = None) -> NDArray[np.bool_]:
    """Return the cells of a rectangular region, so far from its edges in the east and in the north."""
    box, grid = outcome.maps.box, outcome.maps.grid
    rows, cols = np.mgrid[box.row0 : box.row1, box.col0 : box.col1]
    east, north = grid.west_m + (cols + 0.5) * grid.cell_m, grid.south_m + (rows + 0.5) * grid.cell_m
    (x0, y0), (x1, y1) = outcome.regions[region].min(axis=0), outcome.regions[region].max(axis=0)
    across_m = margin_m if across_m is None else across_m
    return (east > x0 + margin_m) & (east < x1 - margin_m) & (north > y0 + across_m) & (north < y1 - across_m)


def zone_at(outcome: Outcome, region: str) -> Zone:
    """Return the largest zone that holds the middle of a region and reaches no more than 3 m beyond it."""
    middle = outcome.regions[region].mean(axis=0)
    row, col = outcome.maps.grid.index(float(middle[0]), float(middle[1]))
    beyond = ~inner(outcome, region, -3.0)
    own = [
        zone
        for zone in outcome.report.zones
        if zone.holds(row, col) and not (zone_mask((zone,), outcome.maps.box) & beyond).any()
    ]
    return max(own, key=lambda zone: zone.area_m2)


def safe_share(outcome: Outcome, cells: NDArray[np.bool_]) -> float:
    return float((outcome.maps.state[cells] == SAFE).mean())


def stands(outcome: Outcome) -> NDArray[np.bool_]:
    """Return the 8 m beyond the court's four sides; the corners between the stands are flat and safe."""
    sides = inner(outcome, "court", -8.0, 4.0) | inner(outcome, "court", 4.0, -8.0)
    return sides & ~inner(outcome, "court", -2.0)


def test_the_source_s_rules_find_court_and_roofs_and_not_the_stands(source: Outcome) -> None:
    court = zone_at(source, "court")
    assert court.area_m2 == pytest.approx(106 * 73, rel=0.1)
    assert safe_share(source, inner(source, "large_roof", 3.0)) > 0.8
    assert safe_share(source, inner(source, "small_roof", 3.0)) > 0.8
    assert safe_share(source, stands(source)) < 0.1


def test_the_source_s_rules_measure_the_court_better_than_published(source: Outcome) -> None:
    """Eq. (20) with the court's 106 x 73 m as ground truth, as the paper does."""
    court = zone_at(source, "court")
    common = float((zone_mask((court,), source.maps.box) & inner(source, "court", 0.0)).sum())
    truth = 106.0 * 73.0
    error = (court.area_m2 - common) / court.area_m2 + (truth - common) / truth
    assert error <= PAPER_AREA_ERROR


def test_the_filters_leave_few_of_many_zones(source: Outcome, folder: Path) -> None:
    unfiltered, _ = run(UNFILTERED, folder)
    assert len(source.report.zones) < len(unfiltered.report.zones) / 3
    assert all(zone.best.square_side_m >= 24 for zone in source.report.zones)


def test_default_mode_finds_court_and_entrance_as_zones_and_both_roofs_safe(default: Outcome) -> None:
    for region, area_m2 in {"court": 106 * 73, "entrance": 55 * 62}.items():
        zone = zone_at(default, region)
        assert 0.6 * area_m2 < zone.area_m2 < 1.05 * area_m2
    assert safe_share(default, stands(default)) == 0
    assert safe_share(default, inner(default, "large_roof", 3.0)) > 0.7
    assert safe_share(default, inner(default, "small_roof", 3.0)) > 0.9


def test_a_growing_zone_keeps_its_number_in_default_mode(default: Outcome, source: Outcome) -> None:
    assert default.ids < source.ids
