"""Reading of PCD, PLY, text and COPC, and refusals in one line."""

from __future__ import annotations

import struct
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from companion.desk.clouds.cloud import GeoreferencedCloud, cloud_format_of, open_source, read
from companion.desk.clouds.crs import from_option
from companion.runtime.errors import UsageError
from tests.unit.companion.desk.survey import packing
from tests.unit.companion.desk.survey.clouds import field, placed, write

CRS = "EPSG:32610"
POINTS = placed(field(5.0), CRS)
KINDS = {
    "ascii.pcd": packing.pcd(POINTS, "ascii"),
    "binary.pcd": packing.pcd(POINTS, "binary"),
    "compressed.pcd": packing.pcd(POINTS, "binary_compressed"),
    "ascii.ply": packing.ply(POINTS, "ascii"),
    "little.ply": packing.ply(POINTS),
    "big.ply": packing.ply(POINTS, "binary_big_endian"),
    "plain.xyz": packing.text(POINTS),
    "tabs.txt": packing.text(POINTS, "\t", "X Y Z Intensity"),
    "commas.csv": packing.text(POINTS, ",", '"x","y","z","intensity"'),
    "semicolons.csv": packing.text(POINTS, ";", "easting;northing;height;n"),
    "cloudcompare.txt": packing.text(POINTS, " ", "//X Y Z R"),
    "comments.asc": b"# by a scanner\n# of no name\n\n" + packing.text(POINTS),
    "windows.csv": packing.text(POINTS, ",", "x,y,z,i").replace(b"\n", b"\r\n"),
}


def put(folder: Path, name: str, content: bytes) -> Path:
    path = folder / name
    path.write_bytes(content)
    return path


def refusal(path: Path, crs: str | None = CRS) -> str:
    with pytest.raises(UsageError) as caught:
        read([path], crs)
    message = str(caught.value)
    assert message.startswith(f"{path}: ")
    assert "\n" not in message
    assert len(message) < 300 + len(str(path))
    return message


@pytest.mark.parametrize("name", KINDS)
def test_every_kind_gives_the_points_to_the_last_bit(tmp_path: Path, name: str) -> None:
    cloud = read([put(tmp_path, name, KINDS[name])], CRS)
    np.testing.assert_array_equal(cloud.points, POINTS)
    assert (cloud.n_read, cloud.coordinate_spacing, cloud.gps_s) == (len(POINTS), 0.0, None)
    assert cloud.reference.name == CRS


@pytest.mark.parametrize("name", ["binary.pcd", "little.ply", "plain.xyz"])
def test_a_kind_that_names_no_crs_asks_for_it(tmp_path: Path, name: str) -> None:
    assert "--crs" in refusal(put(tmp_path, name, KINDS[name]), None)


def test_columns_are_found_by_their_names(tmp_path: Path) -> None:
    turned = POINTS[:, [2, 1, 0]]
    cloud = read([put(tmp_path, "a.csv", packing.text(turned, ",", "alt,lat,lon,n"))], CRS)
    np.testing.assert_array_equal(cloud.points, POINTS)


def test_all_kinds_together_make_one_cloud(tmp_path: Path) -> None:
    las = write(tmp_path / "a.las", POINTS, gps_time=np.zeros(len(POINTS)))
    others = [put(tmp_path, name, KINDS[name]) for name in ("binary.pcd", "big.ply", "plain.xyz")]
    cloud = read([las, *others], CRS)
    assert len(cloud.points) == 4 * len(POINTS)
    assert cloud.gps_s is None


def test_32_bit_coordinates_tell_how_coarse_they_are(tmp_path: Path) -> None:
    path = put(tmp_path, "a.pcd", packing.pcd(POINTS, form="<f4"))
    assert read([path], CRS).coordinate_spacing == 0.5  # of northings of 4.9e6 m
    path = put(tmp_path, "a.ply", packing.ply(POINTS % 1000, kind="float"))
    assert read([path], CRS).coordinate_spacing < 1e-4


@pytest.mark.parametrize("name", ["ascii.pcd", "compressed.pcd", "big.ply", "ascii.ply", "plain.xyz"])
def test_points_that_are_no_numbers_are_dropped_and_counted(tmp_path: Path, name: str) -> None:
    holed = POINTS.copy()
    holed[3, 2], holed[5, 0] = np.nan, np.inf
    content = {
        "ascii.pcd": packing.pcd(holed, "ascii"),
        "compressed.pcd": packing.pcd(holed, "binary_compressed"),
        "big.ply": packing.ply(holed, "binary_big_endian"),
        "ascii.ply": packing.ply(holed, "ascii"),
        "plain.xyz": packing.text(holed),
    }[name]
    cloud = read([put(tmp_path, name, content)], CRS)
    np.testing.assert_array_equal(cloud.points, np.delete(POINTS, [3, 5], axis=0))
    assert cloud.dropped == {"not_finite": 2}
    nothing = packing.text(np.full((4, 3), np.nan))
    assert "none of its 4 points" in refusal(put(tmp_path, "nothing.xyz", nothing))


def test_copc_reads_as_the_laz_that_it_is(tmp_path: Path) -> None:
    path = packing.copc(tmp_path / "a.copc.laz", write(tmp_path / "a.las", POINTS))
    cloud = read([path])
    np.testing.assert_allclose(cloud.points, POINTS, atol=6e-4)
    assert cloud.reference.name == CRS
    path.write_bytes(path.read_bytes()[:-40])
    assert "truncated" in refusal(path, None)


PCD, PLY, TEXT = KINDS["binary.pcd"], KINDS["little.ply"], KINDS["plain.xyz"]
COMPRESSED_HEAD = KINDS["compressed.pcd"].partition(b"DATA binary_compressed\n")[0] + (
    b"DATA binary_compressed\n"
)
RECORD_BYTES = 1 + 3 * 8 + 3 * 4


def block(packed: bytes) -> bytes:
    """Return a block that claims to hold all points, and zeros of which nothing is made."""
    plain = RECORD_BYTES * len(POINTS)
    packed = bytes([31, *bytes(32)]) * (plain // 100 // 33 + 1) + packed
    return struct.pack("<II", len(packed), plain) + packed


@pytest.mark.parametrize(
    ("name", "content", "says"),
    [
        ("a.pcd", b"", "empty"),
        ("a.pcd", b"\x00\x01", "no PCD file"),
        ("a.pcd", PCD[:60], "truncated within its header"),
        ("a.pcd", PCD[:-1000], "truncated"),
        ("a.pcd", KINDS["ascii.pcd"].rsplit(b"\n", 3)[0], "truncated"),
        ("a.pcd", KINDS["compressed.pcd"][:-10], "truncated"),
        ("a.pcd", COMPRESSED_HEAD + bytes(7), f"truncated, 0 of {len(POINTS)} points"),
        ("a.pcd", COMPRESSED_HEAD + struct.pack("<II", 4, 4) + bytes(4), "sizes contradict each other"),
        ("a.pcd", COMPRESSED_HEAD + block(b"\x1f123"), "cannot be unpacked"),  # 32 bytes as they are, of 3
        ("a.pcd", COMPRESSED_HEAD + block(b"\x20"), "cannot be unpacked"),  # a length, and no distance
        ("a.pcd", COMPRESSED_HEAD + block(b"\x00a\xe0"), "cannot be unpacked"),  # no rest of the length
        ("a.pcd", COMPRESSED_HEAD + block(b"\x00a\xe0\x09"), "cannot be unpacked"),  # that, and no distance
        ("a.pcd", COMPRESSED_HEAD + block(b"\x00a\x20\x01"), "cannot be unpacked"),  # from before the first
        ("a.pcd", PCD.replace(b" x ", b" u "), "no x"),
        ("a.pcd", PCD.replace(b"TYPE U F", b"TYPE U I"), "its x is int64"),
        ("a.pcd", PCD.replace(b"COUNT 1 1", b"COUNT 1 2"), "its x is 2 of"),
        ("a.pcd", PCD.replace(b"COUNT 1 1", b"COUNT 1"), "differ in length"),
        ("a.pcd", PCD.replace(b"COUNT 1 1", b"COUNT 0 1"), "a COUNT is not from 1"),
        ("a.pcd", PCD.replace(b"SIZE 1", b"SIZE 3"), "'U3' is no type"),
        ("a.pcd", PCD.replace(b"POINTS ", b"POINTS 9"), "contradict"),
        ("a.pcd", PCD.replace(b"DATA binary", b"DATA zipped"), "'zipped'"),
        ("a.pcd", PCD.replace(b"WIDTH ", b"WIDTH x"), "WIDTH is no number"),
        ("a.pcd", KINDS["ascii.pcd"].replace(b"\n7 ", b"\n7 abc ", 1), "'7 abc"),
        ("a.pcd", packing.pcd(np.zeros((0, 3))), "no points"),
        ("a.ply", b"x", "not a PLY"),
        ("a.ply", PLY[:100], "truncated"),
        ("a.ply", PLY[:-1000], "truncated"),
        ("a.ply", KINDS["ascii.ply"].rsplit(b"\n", 4)[0], "truncated"),
        ("a.ply", PLY.replace(b"double x", b"double u"), "no x"),
        ("a.ply", packing.ply(POINTS % 9, kind="int"), "its x is int32"),
        ("a.ply", PLY.replace(b"double y", b"double x"), "it has x twice"),
        ("a.ply", PLY.replace(b"vertex ", b"corner "), "no vertices"),
        ("a.ply", PLY.replace(b"property float focus", b"property list uchar int a"), "camera has a list"),
        ("a.ply", PLY.replace(b"1.0", b"2.0"), "'format binary_little_endian 2.0'"),
        ("a.ply", packing.ply(np.zeros((0, 3))), "no points"),
        ("a.ply", b"ply\ncomment of nothing\nend_header\n", "it names no format"),
        ("a.xyz", b"\n\n", "no line"),
        ("a.xyz", b"hello world\nhow are you\n", "no line"),
        ("a.xyz", b"1 2\n3 4\n", "no line"),
        ("a.xyz", TEXT + b"1 2\n", "'1 2' is no point"),
        ("a.xyz", TEXT + b"1 2 three\n", "'1 2 three'"),
        ("a.xyz", TEXT + b"\n  \n1 2 three\n", "'1 2 three'"),
        ("a.xyz", TEXT + b"1_0 2 3\n", "its lines are not of numbers"),
        ("a.csv", packing.text(POINTS, ",", "x,y,intensity,n"), "leave out x, y or z"),
        ("a.xyz", b"1" * 100_000, "no text"),
        ("a.png", b"\x89PNG", "not a cloud of a kind"),
        ("a.laz", PCD[30:], "not a LAS or LAZ file"),
    ],
)
def test_what_cannot_be_used_is_one_line_that_names_it(
    tmp_path: Path, name: str, content: bytes, says: str
) -> None:
    assert says in refusal(put(tmp_path, name, content))


def test_more_than_memory_holds_is_refused_before_it_is_read(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("companion.desk.clouds.cloud_source.total_bytes", lambda: 1000)
    for name in ("compressed.pcd", "little.ply", "plain.xyz"):
        assert "do not fit into memory" in _said(put(tmp_path, name, KINDS[name]))


def _said(path: Path) -> str:
    with pytest.raises(UsageError) as caught:
        read([path], CRS)
    return str(caught.value)


def attempt(path: Path) -> GeoreferencedCloud | None:
    """Read a damaged file: points, or one line that names it."""
    cloud, said = None, f"{path}: "
    try:
        cloud = read([path], CRS)
    except UsageError as error:
        said = str(error)
    assert said.startswith(f"{path}: ")
    assert "\n" not in said
    assert cloud is None or np.isfinite(cloud.points).all()
    return cloud


NO_FIXTURE_CHECK = [HealthCheck.function_scoped_fixture]


@settings(deadline=None, max_examples=60, suppress_health_check=NO_FIXTURE_CHECK)
@given(name=st.sampled_from(sorted(KINDS)), share=st.floats(0, 1, exclude_max=True))
def test_a_file_cut_off_anywhere_is_one_clear_line_or_its_beginning(
    tmp_path: Path, name: str, share: float
) -> None:
    content = KINDS[name]
    path = put(tmp_path, name, content[: int(share * len(content))])
    cloud = attempt(path)
    if cloud is not None and path.suffix in (".pcd", ".ply"):
        assert len(cloud.points) == len(POINTS)


@settings(deadline=None, max_examples=80, suppress_health_check=NO_FIXTURE_CHECK)
@given(name=st.sampled_from(sorted(KINDS)), at=st.integers(0, 10**6), bits=st.integers(1, 255))
def test_flipped_bits_are_one_clear_line_or_other_points(
    tmp_path: Path, name: str, at: int, bits: int
) -> None:
    content = bytearray(KINDS[name])
    content[at % (700 if at % 2 else len(content)) % len(content)] ^= bits
    attempt(put(tmp_path, name, bytes(content)))


@settings(deadline=None, max_examples=40, suppress_health_check=NO_FIXTURE_CHECK)
@given(suffix=st.sampled_from([".pcd", ".ply", ".xyz", ".csv"]), content=st.binary(max_size=300))
def test_noise_is_one_clear_line(tmp_path: Path, suffix: str, content: bytes) -> None:
    attempt(put(tmp_path, f"noise{suffix}", content))


def test_kinds_are_told_by_content(tmp_path: Path) -> None:
    assert cloud_format_of(put(tmp_path, "a.las", KINDS["little.ply"])) == "ply"
    assert cloud_format_of(put(tmp_path, "a.txt", KINDS["binary.pcd"])) == "pcd"


def test_a_block_that_does_not_fit_into_memory_is_refused_before_it_is_unpacked(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    source = open_source(put(tmp_path, "a.pcd", KINDS["compressed.pcd"]), from_option(CRS))
    monkeypatch.setattr("companion.desk.clouds.cloud_source.total_bytes", lambda: 1000)
    with pytest.raises(
        UsageError, match=r"a\.pcd: its \d+ bytes do not fit into memory, 700 would: split it"
    ):
        list(source.chunks())
