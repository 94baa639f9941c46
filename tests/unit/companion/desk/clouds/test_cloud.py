"""Reading of LAS and LAZ files, and refusals in one line."""

from __future__ import annotations

import struct
from pathlib import Path

import laspy
import numpy as np
import pytest

from companion.desk.clouds.cloud import open_source, read
from companion.desk.clouds.crs import from_option
from companion.desk.clouds.las import LasSource, open_las, pieces
from companion.runtime.errors import UsageError
from tests.unit.companion.desk.survey import packing
from tests.unit.companion.desk.survey.clouds import field, placed, write

POINTS = placed(field(2.0), "EPSG:32610")


def refusal(files: list[Path], crs: str | None = None) -> str:
    with pytest.raises(UsageError) as caught:
        read(files, crs)
    message = str(caught.value)
    assert "\n" not in message
    assert len(message) < 300
    return message


@pytest.mark.parametrize("suffix", ["las", "laz"])
def test_coordinates_come_in_the_units_of_the_file(tmp_path: Path, suffix: str) -> None:
    points = placed(field(2.0), "EPSG:2992", 0.3048)
    cloud = read([write(tmp_path / f"a.{suffix}", points, "EPSG:2992")])
    np.testing.assert_allclose(cloud.points, points, atol=6e-4)
    assert cloud.reference.name == "EPSG:2992"
    assert cloud.reference.unit_m == 0.3048
    assert cloud.n_read == len(points)


def test_noise_water_and_withheld_points_are_dropped_and_counted(tmp_path: Path) -> None:
    kinds = np.full(len(POINTS), 2)
    kinds[:3], kinds[3:5], kinds[5:9] = 7, 18, 9
    withheld = np.zeros(len(POINTS), int)
    withheld[-2:] = 1
    cloud = read([write(tmp_path / "a.las", POINTS, classification=kinds, withheld=withheld)])
    assert cloud.dropped == {"withheld": 2, "noise": 5, "water": 4, "not_finite": 0}
    np.testing.assert_allclose(cloud.points, POINTS[9:-2], atol=6e-4)


@pytest.mark.parametrize(
    ("kind", "water"), [(39, 0), (40, 4), (41, 4), (42, 4), (43, 4), (44, 0), (45, 4), (46, 0)]
)
def test_what_lies_in_or_under_water_is_dropped_as_water(tmp_path: Path, kind: int, water: int) -> None:
    """Topo-Bathy LiDAR has classes of its own; none of them is ground on which anything can land."""
    kinds = np.full(len(POINTS), 2)
    kinds[5:9] = kind
    path = write(tmp_path / "a.las", POINTS, classification=kinds)
    assert read([path]).dropped["water"] == water
    (columns,) = open_las(path, None).columns(0, len(POINTS))
    assert columns.dropped["water"] == water


def test_several_files_make_one_cloud(tmp_path: Path) -> None:
    times = np.linspace(5.0, 6.0, len(POINTS))
    a = write(tmp_path / "a.las", POINTS, gps_time=times)
    b = write(tmp_path / "b.laz", POINTS + np.array([100.0, 0, 0]), gps_time=times + 1)
    shares: list[float] = []
    cloud = read([a, b], progress=shares.append)
    assert len(cloud.points) == 2 * len(POINTS)
    assert cloud.gps_s is not None
    np.testing.assert_allclose(cloud.gps_s, np.concatenate([times, times + 1]))
    assert shares[-1] == 1.0


def test_no_file_at_all_is_refused() -> None:
    assert refusal([]).startswith("no files: name one or more clouds")


def test_a_file_given_twice_is_refused_by_name(tmp_path: Path) -> None:
    path = write(tmp_path / "a.las", POINTS)
    (tmp_path / "link.las").symlink_to(path)
    assert refusal([path, path]).startswith(f"{path}: it is given twice")
    assert refusal([path, tmp_path / "link.las"]).startswith(f"{tmp_path / 'link.las'}: it is given twice")


def test_files_of_two_crs_are_refused_by_name(tmp_path: Path) -> None:
    a = write(tmp_path / "a.las", POINTS)
    b = write(tmp_path / "b.las", POINTS, "EPSG:32611")
    message = refusal([a, b])
    assert str(a) in message
    assert str(b) in message
    assert "EPSG:32611" in message


def test_files_whose_heights_differ_in_unit_are_refused(tmp_path: Path) -> None:
    a = write(tmp_path / "a.las", POINTS, "EPSG:32610+5703")
    b = write(tmp_path / "b.las", POINTS, "EPSG:32610+6360")
    assert str(b) in refusal([a, b])


def test_files_whose_heights_differ_in_datum_are_refused(tmp_path: Path) -> None:
    a = write(tmp_path / "a.las", POINTS, "EPSG:32610+5703")
    b = write(tmp_path / "b.las", POINTS, "EPSG:32610+5773")
    untold = write(tmp_path / "c.las", POINTS)  # most files name no datum of their heights
    for files in ([a, b], [untold, a, b]):
        message = refusal(files)
        assert message.startswith(f"{b}: ")
        assert "EPSG:32610+5773" in message
    assert read([untold, a]).n_read == 2 * len(POINTS)


def test_a_file_without_crs_names_the_option(tmp_path: Path) -> None:
    path = write(tmp_path / "a.las", POINTS, None)
    message = refusal([path])
    assert str(path) in message
    assert "--crs" in message
    assert read([path], "EPSG:32610").reference.name == "EPSG:32610"


def test_the_option_overrides_the_file(tmp_path: Path) -> None:
    path = write(tmp_path / "a.las", POINTS)
    assert read([path], "EPSG:26910").reference.name == "EPSG:26910"
    assert "--crs 'EPSG:1'" in refusal([path], "EPSG:1")


def damaged(tmp_path: Path, kind: str) -> Path:
    las, laz = tmp_path / "a.las", tmp_path / "a.laz"
    data = write(las, POINTS).read_bytes()
    packed = write(laz, POINTS).read_bytes()
    (points_at,) = struct.unpack_from("<I", packed, 96)
    match kind:
        case "empty":
            las.write_bytes(b"")
        case "not LAS":
            las.write_bytes(b"x y z\n1 2 3\n")
        case "truncated LAS":
            las.write_bytes(data[:-100])
        case "truncated within":
            las.write_bytes(data[:200])
        case "truncated LAZ":
            laz.write_bytes(packed[: (points_at + len(packed)) // 2])
            return laz
        case "corrupt LAZ":
            noise = np.random.default_rng(1).bytes(len(packed) - points_at - 30)
            laz.write_bytes(packed[: points_at + 8] + noise + packed[-22:])
            return laz
        case "endless points":
            laz.write_bytes(packed[:247] + struct.pack("<Q", 10**12) + packed[255:])
            return laz
        case "one point less":
            las.write_bytes(data[:247] + struct.pack("<Q", len(POINTS) - 1) + data[255:])
        case "one LAZ point less":
            laz.write_bytes(packed[:247] + struct.pack("<Q", len(POINTS) - 1) + packed[255:])
            return laz
        case "one COPC point less":
            copc = packing.copc(laz, las).read_bytes()
            laz.write_bytes(copc[:247] + struct.pack("<Q", len(POINTS) - 1) + copc[255:])
            return laz
        case "one chunk less":
            header = laspy.LasHeader(point_format=3, version="1.2")
            with laspy.open(laz, "w", header=header) as writer:
                writer.write_points(laspy.ScaleAwarePointRecord.zeros(100_001, header=header))
            old = laz.read_bytes()
            laz.write_bytes(old[:107] + struct.pack("<I", 100_000) + old[111:])
            return laz
        case "endless records":
            las.write_bytes(data[:100] + struct.pack("<I", 2**32 - 1) + data[104:])
        case "future version":
            las.write_bytes(data[:25] + b"\x09" + data[26:])
        case "no points":
            write(las, np.zeros((0, 3)))
        case "NaN scale":
            las.write_bytes(data[:131] + struct.pack("<d", np.nan) + data[139:])
        case "zero scale":
            las.write_bytes(data[:139] + struct.pack("<d", 0.0) + data[147:])
        case "missing":
            las.unlink()
        case "folder":
            return tmp_path
    return las


@pytest.mark.parametrize(
    ("kind", "word"),
    [
        ("missing", "no such file"),
        ("folder", "it is a folder"),
        ("empty", "empty"),
        ("not LAS", "not a LAS or LAZ file"),
        ("truncated LAS", "truncated"),
        ("truncated within", "truncated"),
        ("truncated LAZ", "truncated or corrupt"),
        ("corrupt LAZ", "corrupt"),
        ("endless points", "its chunks hold 50000 at most"),
        ("one point less", f"tells of {len(POINTS) - 1} points, at least 1 follow"),
        ("one LAZ point less", f"tells of {len(POINTS) - 1} points, at least 1 follow"),
        ("one COPC point less", f"tells of {len(POINTS) - 1} points, at least 1 follow"),
        ("one chunk less", "tells of 100000 points, at least 1 follow"),
        ("endless records", "header is corrupt"),
        ("future version", "LAS 1.9"),
        ("no points", "no points"),
        ("NaN scale", "its scales are nan, 0.001, 0.001"),
        ("zero scale", "its scales are 0.001, 0, 0.001"),
    ],
)
def test_an_unusable_file_is_refused_in_one_line_that_names_it(tmp_path: Path, kind: str, word: str) -> None:
    path = damaged(tmp_path, kind)
    message = refusal([path])
    assert message.startswith(f"{path}: ")
    assert word in message


def test_more_points_than_memory_are_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = write(tmp_path / "a.las", POINTS)
    monkeypatch.setattr("companion.desk.clouds.cloud_source.total_bytes", lambda: 10_000)
    assert "do not fit into memory" in refusal([path])


def test_a_file_that_became_shorter_after_it_was_opened_is_refused_by_name(tmp_path: Path) -> None:
    las, pcd = write(tmp_path / "a.las", POINTS), tmp_path / "a.pcd"
    pcd.write_bytes(packing.pcd(POINTS))
    opened = [open_source(path, from_option("EPSG:32610")) for path in (las, pcd)]
    write(las, POINTS[:40])
    pcd.write_bytes(packing.pcd(POINTS)[:-10])
    assert isinstance(opened[0], LasSource)
    for reading, path, left in (
        (pieces(las, len(POINTS)), las, 40),
        (opened[0].columns(0, len(POINTS)), las, 40),
        (opened[0].columns(30, len(POINTS)), las, 40),
        (opened[1].chunks(), pcd, len(POINTS) - 1),
    ):
        with pytest.raises(UsageError) as caught:
            list(reading)
        assert str(caught.value) == f"{path}: it is truncated, {left} of {len(POINTS)} points: copy it again"


@pytest.mark.parametrize("chunks", [1, 2**31])
def test_a_laz_file_whose_table_is_told_of_at_its_end_is_read_like_any(tmp_path: Path, chunks: int) -> None:
    """A writer that cannot go back, as into a pipe, puts the table's place into the last eight bytes."""
    path = write(tmp_path / "a.laz", POINTS)
    data = bytearray(path.read_bytes())
    (points_at,) = struct.unpack_from("<I", data, 96)
    table = data[points_at : points_at + 8]
    (table_at,) = struct.unpack("<q", table)
    data[points_at : points_at + 8] = struct.pack("<q", -1)
    struct.pack_into("<I", data, table_at + 4, chunks)
    path.write_bytes(data + table)
    if chunks == 1:
        np.testing.assert_allclose(read([path]).points, POINTS, atol=6e-4)
    else:
        assert f"its table names {chunks} chunks" in refusal([path])
