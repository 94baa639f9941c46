"""Surface of a tiled survey: lakes, roofs and trees of a LAS file, whatever the tiles and files."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from companion.desk.survey.tiled.surface_parts import SIDE, SurfaceParts
from companion.desk.survey.tiled.tile_store import Store
from companion.desk.survey.tiled.tiled_survey import Surveyed
from slz import Box
from slz.surface.surface_kinds import SurfaceKind
from tests.unit.companion.desk.survey.clouds import write
from tests.unit.companion.desk.survey.tiled.ground import surveyed

Floats = NDArray[np.float64]
CORNER = np.array([500_020.0, 4_500_030.0, 100.0])  # blocks of 128 m end inside
SIDE_M, LAKE_M, RADIUS_M = 160.0, np.array([98.0, 98.0]), 20.0
HOUSE_M, WOOD_M, HALF_M = np.array([30.0, 30.0]), np.array([30.0, 120.0]), 8.0
UNKNOWN, UNCLASSIFIED, GROUND, TREE, BUILDING = 255, 1, 2, 5, 6


def within(xy: Floats, middle: Floats, half_m: float) -> NDArray[np.bool_]:
    return np.asarray((np.abs(xy - middle) < half_m).all(axis=1))


def cloud(per_m2: float = 4.0) -> Floats:
    """Return ground that slopes by 2 % with a lake in it, in metres of the CRS."""
    rng = np.random.default_rng(6)
    xy = rng.uniform(0, SIDE_M, (round(per_m2 * SIDE_M**2), 2))
    away = np.hypot(*(xy - LAKE_M).T) - RADIUS_M
    z = np.where(away < 0, 0, 0.1 * np.minimum(away, 10) + 0.02 * np.maximum(0, away - 10))
    return np.asarray(np.column_stack([xy, z + rng.normal(0, 0.012, len(xy))]) + CORNER)


CLOUD = cloud()


def survey(folder: Path, tile_m: float | None = None, **fields: Any) -> Surveyed:
    path = write(
        folder / "a.las", CLOUD, classification=fields.pop("kinds", np.full(len(CLOUD), 1)), **fields
    )
    return surveyed([path], folder / "work", tile_m)


def maps(found: Surveyed) -> dict[str, NDArray[Any]]:
    store = Store(found.layout)
    return {name: store.read(name, store.grid.everything) for name in ("surface", "water", "state")}


def distances(found: Surveyed, middle: Floats) -> tuple[Floats, Floats]:
    """Return the distances of the map's cells from a place, along east and north."""
    whole, cell_m = found.layout.whole, found.layout.cell_m
    east = (np.arange(whole.col0, whole.col1) + 0.5) * cell_m - CORNER[0] - middle[0]
    north = (np.arange(whole.row0, whole.row1) + 0.5) * cell_m - CORNER[1] - middle[1]
    across, along = np.meshgrid(np.abs(east), np.abs(north))
    return across, along


@pytest.fixture(scope="module")
def lake(tmp_path_factory: pytest.TempPathFactory) -> Surveyed:
    return survey(tmp_path_factory.mktemp("lake"))


def test_water_is_suspected_and_never_safe(lake: Surveyed) -> None:
    found, away = maps(lake), np.hypot(*distances(lake, LAKE_M))
    assert found["water"][away < RADIUS_M - 2].min() > 0.05
    assert (found["state"][away < RADIUS_M - 2] == UNKNOWN).all()
    assert found["water"][away > RADIUS_M + 4].max() <= 0.05
    assert (found["state"][away > RADIUS_M + 12] == 1).mean() > 0.8
    assert (found["surface"][away > RADIUS_M + 12] == SurfaceKind.BARE).mean() > 0.9


def test_the_surface_is_the_same_for_any_tiles(lake: Surveyed, tmp_path: Path) -> None:
    expected = maps(lake)
    for name, values in maps(survey(tmp_path, 40.0)).items():
        np.testing.assert_array_equal(values, expected[name], name)


def test_the_surface_is_the_same_for_any_order_of_points_in_any_files(lake: Surveyed, tmp_path: Path) -> None:
    order = np.random.default_rng(1).permutation(len(CLOUD))
    paths = [
        write(tmp_path / f"{k}.las", CLOUD[part], classification=np.full(len(part), UNCLASSIFIED))
        for k, part in enumerate(np.array_split(order, 3))
    ]
    expected = maps(lake)
    for name, values in maps(surveyed(paths, tmp_path / "work")).items():
        np.testing.assert_array_equal(values, expected[name], name)


def test_a_lake_across_the_edge_of_a_part_is_the_same_lake(lake: Surveyed, tmp_path: Path) -> None:
    """The edge leaves a strip of 5 m of it, too small for a lake of its own."""
    edge = np.ceil(CORNER[0] / SIDE) * SIDE
    moved = CLOUD + np.array([edge - CORNER[0] - LAKE_M[0] - RADIUS_M + 5, 0, 0])
    found = surveyed([write(tmp_path / "a.las", moved)], tmp_path / "work")
    assert len(list(found.layout.surface.folder.iterdir())) == 2
    np.testing.assert_allclose(maps(found)["water"], maps(lake)["water"], atol=1e-3)


def test_a_place_is_told_as_its_cells_are(lake: Surveyed) -> None:
    store, whole = Store(lake.layout), lake.layout.whole
    offset = CORNER[:2] - np.array([whole.col0, whole.row0]) * lake.layout.cell_m
    water = store.surface_at(np.array([*(LAKE_M + offset), 0.0]), 2.0)
    ground = store.surface_at(np.array([*(HOUSE_M + offset), 0.0]), 2.0)
    assert water.water > 0.3
    assert ground.kind is SurfaceKind.BARE
    assert ground.water <= 0.05


def test_buildings_are_roofs_and_trees_are_canopy_by_their_class(tmp_path: Path) -> None:
    xy = CLOUD[:, :2] - CORNER[:2]
    kinds = np.full(len(CLOUD), GROUND)
    kinds[within(xy, HOUSE_M, HALF_M)], kinds[within(xy, WOOD_M, HALF_M)] = BUILDING, TREE
    found = survey(tmp_path, kinds=kinds)
    kind = maps(found)["surface"]
    for middle, expected in ((HOUSE_M, SurfaceKind.ROOF), (WOOD_M, SurfaceKind.CANOPY)):
        away = np.maximum(*distances(found, middle))
        assert (kind[away < HALF_M - 1] == expected).mean() > 0.9
        assert not (kind[(away > HALF_M + 1) & (away < HALF_M + 4)] == expected).any()


def test_an_unclassified_crop_is_low_vegetation_by_the_depths_of_its_returns(tmp_path: Path) -> None:
    rng, grown = np.random.default_rng(2), CLOUD.copy()
    crop = within(CLOUD[:, :2] - CORNER[:2], WOOD_M, 2 * HALF_M)
    grown[crop, 2] += 0.8 - np.minimum(rng.exponential(0.3, np.count_nonzero(crop)), 0.8)
    found = surveyed([write(tmp_path / "a.las", grown)], tmp_path / "work")
    whole, cell_m = found.layout.whole, found.layout.cell_m
    at = CORNER[:2] + WOOD_M - np.array([whole.col0, whole.row0]) * cell_m
    here = Store(found.layout).surface_at(np.array([*at, 0.0]), HALF_M)
    assert here.kind is SurfaceKind.LOW_VEGETATION
    assert here.probability > 0.8


def test_nothing_is_told_where_no_part_is(lake: Surveyed, tmp_path: Path) -> None:
    nowhere = SurfaceParts(tmp_path, lake.layout.cell_m)
    assert not nowhere.read(Box(-3, 5, 1020, 1030)).values.any()
