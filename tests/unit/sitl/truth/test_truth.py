"""Truth about safe ground, against a plane fit cell by cell, and as files."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
import rasterio
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from rasterio.warp import transform

from sitl.scenes.scene import Scene
from sitl.truth import truth
from sitl.world.primitives import Box, Cylinder, Ellipsoid, Ground, Kind, Solid, Wire
from sitl.world.world import World

F64 = NDArray[np.float64]
EXTENT = (-8.0, -8.0, 8.0, 8.0)


def sloping(rise_east: float = 0.0, rise_north: float = 0.0, kind: Kind = Kind.GRASS) -> Ground:
    x, y = np.meshgrid(np.arange(-10.0, 11.0), np.arange(-10.0, 11.0))
    z = rise_east * x + rise_north * y
    return Ground(-10.0, -10.0, 1.0, z, np.full((20, 20), kind, np.uint8))


def unsafe_reach(solids: list[Solid], footprint_m: float = 2.0) -> tuple[float, float]:
    """Return how far from the origin, along x and along y, cells are unsafe."""
    safe = truth.safe_map(World(sloping(), solids), EXTENT, footprint_m=footprint_m).safe
    rows, columns = np.nonzero(safe == 0)
    return float(columns.max() + 1) * 0.2 - 8.0, float(rows.max() + 1) * 0.2 - 8.0


@pytest.mark.parametrize(("slope_deg", "expected"), [(9.9, 1), (10.1, 0)])
@pytest.mark.parametrize("towards_deg", [0.0, 37.0, 90.0, 200.0])
def test_slope_is_the_steepest_of_the_plane(slope_deg: float, expected: int, towards_deg: float) -> None:
    gradient, towards = np.tan(np.radians(slope_deg)), np.radians(towards_deg)
    ground = sloping(gradient * np.cos(towards), gradient * np.sin(towards))
    found = truth.safe_map(World(ground), EXTENT)
    np.testing.assert_allclose(found.slope_deg, slope_deg, atol=1e-4)
    np.testing.assert_allclose(found.relief_m, 0.0, atol=1e-6)
    assert (found.safe == expected).all()


@pytest.mark.parametrize(
    "solid",
    [
        Cylinder(0.0, 0.0, 0.0, 0.004, 3.0, name="aerial"),
        Cylinder(0.05, 0.05, 0.0, 0.02, 3.0, name="between the samples"),
        Box(0.0, 0.0, 0.0, 0.01, 0.01, 2.0, 0.3, name="stake"),
        Ellipsoid(0.0, 0.0, 0.3, 0.03, 0.03, 0.3, Kind.ROCK),
    ],
)
def test_a_thin_post_spoils_every_footprint_it_stands_in(solid: Solid) -> None:
    safe = truth.safe_map(World(sloping(), [solid]), EXTENT).safe
    rows, columns = np.nonzero(safe == 0)
    x, y = (columns + 0.5) * 0.2 - 8.0, (rows + 0.5) * 0.2 - 8.0
    assert np.abs(np.concatenate([x, y])).max() == pytest.approx(0.9, abs=0.21)
    assert safe[35:45, 35:45].sum() == 0


def test_a_wire_spoils_the_strip_below_it() -> None:
    along, across = unsafe_reach([Wire((-6.0, 0.03, 5.0), (6.0, 0.03, 7.0), 0.003)])
    assert along == pytest.approx(7.0, abs=0.21)
    assert across == pytest.approx(1.0, abs=0.21)


def test_a_small_bump_is_relief_not_danger() -> None:
    low, high = Cylinder(0, 0, 0, 0.3, 0.25), Cylinder(0, 0, 0, 0.3, 0.35)
    assert truth.safe_map(World(sloping(), [low]), EXTENT).safe.all()
    assert not truth.safe_map(World(sloping(), [high]), EXTENT).safe.all()


def test_water_and_the_edge_of_the_world_are_not_safe() -> None:
    assert not truth.safe_map(World(sloping(kind=Kind.WATER)), EXTENT).safe.any()
    safe = truth.safe_map(World(sloping()), (-10.0, -10.0, 10.0, 10.0)).safe
    inside = np.zeros_like(safe)
    inside[5:-5, 5:-5] = 1  # half a footprint of 2 m is five cells of 0.2 m
    np.testing.assert_array_equal(safe, inside)


def test_a_car_is_judged_where_it_stands_now() -> None:
    world = World(sloping())
    world.add_car("car", -5.0, 0.0, 0.0)
    before = truth.safe_map(world, EXTENT).safe
    world.move("car", 5.0, 0.0, 0.0)
    after = truth.safe_map(world, EXTENT).safe
    assert before[40, 15] == after[40, 65] == 0
    assert before[40, 65] == after[40, 15] == 1


@settings(max_examples=12, deadline=None)
@given(st.integers(0, 2**32 - 1), st.sampled_from([(0.2, 2.0), (0.5, 3.0), (0.3, 1.0), (0.1, 0.7)]))
def test_every_cell_is_what_least_squares_says(seed: int, sizes: tuple[float, float]) -> None:
    cell, footprint = sizes
    rng = np.random.default_rng(seed)
    z = rng.normal(0.0, 0.08, (21, 21)) + 0.1 * np.arange(21)
    world = World(
        Ground(-10.0, -10.0, 1.0, z, np.full((20, 20), 1, np.uint8)), [Box(1, 2, -1, 3, 2, 2.5, 0.4)]
    )
    found = truth.safe_map(world, EXTENT, cell, footprint)
    pitch = cell / np.ceil(cell / 0.1 - 1e-9)
    for _ in range(8):
        row, column = (int(rng.integers(n)) for n in found.safe.shape)
        x, y = EXTENT[0] + (column + 0.5) * cell, EXTENT[1] + (row + 0.5) * cell
        slope, relief = _by_least_squares(world, x, y, footprint, pitch, cell)
        assert found.slope_deg[row, column] == pytest.approx(slope, abs=1e-3)
        assert found.relief_m[row, column] == pytest.approx(relief, abs=1e-5)
        assert found.safe[row, column] == (slope <= 10.0 and relief <= 0.3)


def _by_least_squares(
    world: World, x: float, y: float, footprint: float, pitch: float, cell: float
) -> tuple[float, float]:
    per_cell = round(cell / pitch)
    lattice = (np.arange(-200, 200) + (0.5 if per_cell % 2 == 0 else 0.0)) * pitch
    inside = lattice[np.abs(lattice) - pitch / 2 < footprint / 2 - 1e-9]
    dx, dy = (a.ravel() for a in np.meshgrid(inside, inside))
    z, _ = world.surface(x + dx, y + dy)
    design = np.column_stack([np.ones_like(dx), dx, dy])
    plane, *_ = np.linalg.lstsq(design, z, rcond=None)
    slope = float(np.degrees(np.arctan(np.hypot(plane[1], plane[2]))))
    return slope, float(np.ptp(z - design @ plane))


def test_files_open_with_the_right_place_orientation_and_content(tmp_path: Path) -> None:
    world = World(sloping(), [Cylinder(4.0, -3.0, 0.0, 0.5, 2.0, Kind.METAL, "mast")])
    world.add_car("van", 0.0, 5.0, 0.0)
    scene = Scene("test", 7, world, (1.0, 2.0, 0.5), "a field", {"all": ((-8, -8), (8, -8), (8, 8))})
    truth.write(tmp_path / "out", scene, (47.4, 8.5, 490.0), extent=EXTENT)
    with rasterio.open(tmp_path / "out" / "truth.tif") as file:
        assert file.dtypes == ("uint8",)
        safe = file.read(1)
        assert set(np.unique(safe)) == {0, 1}
        assert safe[file.index(4.0, -3.0)] == safe[file.index(0.0, 5.0)] == 0
        assert safe[file.index(-4.0, -3.0)] == 1
        (longitude,), (latitude,) = transform(file.crs, "EPSG:4326", [0.0], [0.0])
        assert (latitude, longitude) == pytest.approx((47.4, 8.5), abs=1e-9)
        assert file.tags()["footprint_m"] == "2.0"
    with rasterio.open(tmp_path / "out" / "dsm_truth.tif") as file:
        assert file.read(1)[file.index(4.0, -3.0)] == pytest.approx(2.0)
        assert file.bounds == pytest.approx(EXTENT)
    document = json.loads((tmp_path / "out" / "scene.json").read_text())
    assert document["origin"] == {"lat_deg": 47.4, "lon_deg": 8.5, "alt_m": 490.0}
    assert document["home_enu_m"] == [1.0, 2.0, 0.0]
    assert document["footprint_m"] == 2.0
    mast = next(item for item in document["objects"] if item["name"] == "mast")
    assert (mast["kind"], mast["shape"], mast["size_m"]) == ("metal", "cylinder", [1.0, 1.0, 2.0])
    assert {item["mover"] for item in document["objects"] if "mover" in item} == {"van"}
    assert document["regions"]["all"] == [[-8, -8], [8, -8], [8, 8]]


def test_an_extent_smaller_than_a_cell_is_refused() -> None:
    with pytest.raises(ValueError, match=r"holds no cell of 0\.2 m"):
        truth.safe_map(World(sloping()), (0.0, 0.0, 0.1, 5.0))
