"""Work plan of a survey: its pieces, and reuse of an earlier run's work."""

from __future__ import annotations

import math
import struct
from pathlib import Path

import numpy as np
import pytest

from companion.desk.clouds.cloud import open_clouds, open_source
from companion.desk.clouds.crs import from_option
from companion.desk.survey import MapOptions
from companion.desk.survey.tiled.census import first_guess
from companion.desk.survey.tiled.lattice import Lattice
from companion.desk.survey.tiled.plan import MANIFEST, claim, spacing
from companion.desk.survey.tiled.tile_labels import CandidateZone
from companion.desk.survey.tiled.tiled_zones import batches
from companion.runtime.errors import UsageError
from slz import Box
from tests.unit.companion.desk.survey import packing
from tests.unit.companion.desk.survey.clouds import LAT, LON, field, placed, write
from tests.unit.companion.desk.survey.tiled.ground import parameters

DEGREES = placed(field(5.0), "EPSG:4326")


def test_no_file_at_all_is_refused() -> None:
    with pytest.raises(UsageError, match="no files: name one or more clouds"):
        open_clouds([], None)


@pytest.mark.parametrize("tile_m", [0.0, -5.0, math.inf, math.nan])
def test_a_tile_without_a_length_is_refused(tmp_path: Path, tile_m: float) -> None:
    with pytest.raises(UsageError, match=f"--tile-m {tile_m:g}: a length in metres"):
        MapOptions(tile_m=tile_m).check(tmp_path, parameters())


def test_a_manifest_that_cannot_be_read_is_that_of_another_survey(tmp_path: Path) -> None:
    assert not claim(tmp_path, {"version": 1})
    assert claim(tmp_path, {"version": 1})
    (tmp_path / MANIFEST).write_text('{"vers', "utf-8")
    with pytest.raises(UsageError, match="with other version: run that one again"):
        claim(tmp_path, {"version": 1})


def test_degrees_have_the_length_they_have_where_the_first_point_lies(tmp_path: Path) -> None:
    (tmp_path / "a.ply").write_bytes(packing.ply(DEGREES))
    source = open_source(tmp_path / "a.ply", from_option("EPSG:4326"))
    lattice = first_guess([source], 0.5)
    assert lattice.x_m == pytest.approx(111_412 * math.cos(math.radians(LAT)), rel=2e-3)
    assert lattice.y_m == pytest.approx(111_110, rel=2e-3)
    assert (lattice.z_m, lattice.cell_m) == (1.0, 0.5)


@pytest.mark.parametrize("edge", [math.nan, math.inf, 1e300, 900.0])
def test_a_bounding_box_that_is_no_place_leaves_it_to_the_points(tmp_path: Path, edge: float) -> None:
    path = write(tmp_path / "a.laz", DEGREES, "EPSG:4326")
    data = bytearray(path.read_bytes())
    struct.pack_into("<6d", data, 179, *[edge] * 6)  # max x, min x, max y, min y, max z, min z
    path.write_bytes(data)
    lattice = first_guess([open_source(path, None)], 0.5)
    assert lattice.x_m == pytest.approx(111_412 * math.cos(math.radians(LAT)), rel=2e-3)
    assert lattice.y_m == pytest.approx(111_110, rel=2e-3)


def test_a_cloud_in_degrees_without_a_usable_point_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "a.ply"
    path.write_bytes(packing.ply(np.full((9, 3), np.nan)))
    with pytest.raises(UsageError, match=r"a\.ply: none of its points is usable"):
        first_guess([open_source(path, from_option("EPSG:4326"))], 0.5)


def test_32_bit_coordinates_are_as_coarse_as_where_the_survey_is_farthest_from_zero(tmp_path: Path) -> None:
    (tmp_path / "a.pcd").write_bytes(packing.pcd(np.array([[LON, LAT, 0.0]]), form="<f4"))
    (tmp_path / "b.pcd").write_bytes(packing.pcd(np.array([[LON, LAT, 0.0]])))
    single, double = (open_source(tmp_path / name, from_option("EPSG:32610")) for name in ("a.pcd", "b.pcd"))
    lattice = Lattice(1.0, 1.0, 1.0, 0.5)
    north = Box(9_000_000, 9_000_100, 0, 10)  # of 4.5e6 m
    assert spacing([double, single], north, lattice) == 0.5
    assert spacing([single], Box(-10, 0, -4_000_000, -10), lattice) == 0.125  # of 2e6 m
    assert spacing([double], north, lattice) == 0.0


def test_zones_are_worked_out_in_batches_of_like_size_the_largest_first(tmp_path: Path) -> None:
    sides = [10, 4, 4, 30, 5]
    zones = [CandidateZone(Box(0, n, 0, n), k, (((0, k), (1,)),)) for k, n in enumerate(sides)]
    work = batches(zones, tmp_path, most_cells=140)
    assert [[zone.first for zone in one.zones] for one in work] == [[3], [0, 1, 2], [4]]
    assert len({one.done for one in work}) == 3
