"""Headers of PCD, PLY, text and LAS as other programs write them: read, or refused in one line."""

from __future__ import annotations

import struct
from pathlib import Path

import laspy
import numpy as np
import pytest

from companion.desk.clouds.cloud import read
from companion.desk.clouds.crs import from_option
from companion.desk.clouds.pcd import open_pcd
from companion.runtime.errors import CompanionError, UsageError
from tests.unit.companion.desk.survey.clouds import write

CRS = "EPSG:32610"
POINTS = np.array(
    [[500_000.25, 4_900_000.5, 100.0], [500_001.5, 4_900_001.25, 101.5], [500_002, 4_900_003, 99]]
)
XYZ = [" ".join(map(repr, row)) for row in POINTS.tolist()]
PLAIN = POINTS.astype("<f8").tobytes()


def put(path: Path, content: bytes | str) -> Path:
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    return path


def refusal(path: Path, crs: str | None = CRS) -> str:
    with pytest.raises(CompanionError) as caught:
        read([path], crs)
    assert isinstance(caught.value, UsageError)  # exit code 2
    message = str(caught.value)
    assert message.startswith(f"{path}: ")
    assert message.isprintable()
    return message


def records(*columns: tuple[str, str]) -> bytes:
    """Return binary records with x, y, z at their places, zeros elsewhere; columns: name and NumPy type."""
    table = np.zeros(len(POINTS), [(f"{k}{name}", form) for k, (name, form) in enumerate(columns)])
    for k, (name, _) in enumerate(columns):
        if name in "xyz":
            table[f"{k}{name}"] = POINTS[:, "xyz".index(name)]
    return table.tobytes()


def ascii_rows(before: str = "", after: str = "") -> str:
    return "".join(f"{before}{row}{after}\n" for row in XYZ)


SIZES = "SIZE 8 8 8\nTYPE F F F\nCOUNT 1 1 1\n"
COUNTS = "WIDTH 3\nHEIGHT 1\nVIEWPOINT 0 0 0 1 0 0 0\nPOINTS 3\n"
TITLE = "# .PCD v0.7 - Point Cloud Data file format\nVERSION 0.7\n"
PLAINLY = f"VERSION 0.7\nFIELDS x y z\n{SIZES}"
FRAME = COUNTS.replace("1 0 0 0", "1 0 0 0 170 radar 3")
X, Y, Z = ("x", "<f8"), ("y", "<f8"), ("z", "<f8")
PAD = ("_", "u1")
INTEGERS = [(letter, f"<{kind}{size}") for letter, kind in (("a", "i"), ("b", "u")) for size in (1, 2, 4, 8)]


def pcd(head: str, body: bytes | str = PLAIN, data: str = "binary") -> bytes:
    return f"{head}DATA {data}\n".encode() + (body if isinstance(body, bytes) else body.encode())


PCDS: dict[str, bytes] = {
    "PCL, ascii": pcd(
        f"{TITLE}FIELDS x y z rgb\nSIZE 8 8 8 4\nTYPE F F F F\nCOUNT 1 1 1 1\n{COUNTS}",
        ascii_rows(after=" 4.2108e+06"),
        "ascii",
    ),
    "PCL, padding": pcd(
        f"{TITLE}FIELDS x y z _ intensity ring _ timestamp\nSIZE 8 8 8 1 4 2 1 8\nTYPE F F F U F U U F\n"
        f"COUNT 1 1 1 4 1 1 2 1\n{COUNTS}",
        records(X, Y, Z, *[PAD] * 4, ("i", "<f4"), ("r", "<u2"), *[PAD] * 2, ("t", "<f8")),
    ),
    "PCL, every type": pcd(
        f"{TITLE}FIELDS a b c d e f g h x y z valid\nSIZE 1 2 4 8 1 2 4 8 8 8 8 1\n"
        f"TYPE I I I I U U U U F F F B\nCOUNT 1 1 1 1 1 1 1 1 1 1 1 1\n{COUNTS}",
        records(*INTEGERS, X, Y, Z, ("v", "u1")),
    ),
    "PCL, histogram before": pcd(
        f"{TITLE}FIELDS fpfh x y z\nSIZE 4 8 8 8\nTYPE F F F F\nCOUNT 33 1 1 1\n{COUNTS}",
        records(*[("h", "<f4")] * 33, X, Y, Z),
    ),
    "Open3D": pcd(
        f"{TITLE}FIELDS x y z normal_x normal_y normal_z rgb\nSIZE 8 8 8 4 4 4 4\nTYPE F F F F F F U\n"
        f"COUNT 1 1 1 1 1 1 1\n{COUNTS}",
        ascii_rows(after=" 0 0 1 4278190080"),
        "ascii",
    ),
    "pypcd, incompressible": pcd(
        PLAINLY + COUNTS,
        struct.pack("<II", len(PLAIN), len(PLAIN)) + np.ascontiguousarray(POINTS.T).astype("<f8").tobytes(),
        "binary_compressed",
    ),
    "PCL, compressed without padding": pcd(
        f"{TITLE}FIELDS x y _ z\nSIZE 8 8 1 8\nTYPE F F U F\nCOUNT 1 1 4 1\n{COUNTS}",
        struct.pack("<II", len(PLAIN), len(PLAIN)) + np.ascontiguousarray(POINTS.T).astype("<f8").tobytes(),
        "binary_compressed",
    ),
    "pcl_ros, organised": pcd(f"{PLAINLY}WIDTH 1\nHEIGHT 3\nVIEWPOINT 0 0 0 1 0 0 0\nPOINTS 3\n"),
    "pose of no turn, of either sign": pcd(PLAINLY + COUNTS.replace("1 0 0 0", "-1 0 0 -1e-9")),
    "pose of zeros": pcd(PLAINLY + COUNTS.replace("1 0 0 0", "0 0 0 0")),
    "version .5": pcd("# .PCD v.5\nVERSION .5\nCOLUMNS x y z\nPOINTS 3\n", ascii_rows(), "ascii"),
    "version .6, no COUNT": pcd(
        "VERSION .6\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nWIDTH 3\nHEIGHT 1\nPOINTS 3\n",
        ascii_rows(),
        "ascii",
    ),
    "no WIDTH": pcd(f"{PLAINLY}POINTS 3\n"),
    "no POINTS": pcd(f"{PLAINLY}WIDTH 3\nHEIGHT 1\n"),
    "lower case": pcd((PLAINLY + COUNTS).lower(), data="BINARY").replace(b"DATA", b"data"),
    "fields in capitals": pcd(f"VERSION 0.7\nFIELDS X Y Z\n{SIZES}{COUNTS}"),
    "other order of lines": pcd("".join(f"{line}\n" for line in (PLAINLY + COUNTS).splitlines()[::-1])),
    "comments and blanks": pcd(f"# a\n\nVERSION 0.7\n#b\nFIELDS\tx  y z \n{SIZES}# c d\n{COUNTS}"),
    "frame in VIEWPOINT": pcd(PLAINLY + FRAME),
    "Windows": pcd(PLAINLY + COUNTS, b"").replace(b"\n", b"\r\n") + PLAIN,
    "mark of UTF-8": b"\xef\xbb\xbf" + pcd(TITLE + PLAINLY[12:] + COUNTS, ascii_rows(), "ascii"),
    "zeros behind": pcd(PLAINLY + COUNTS, PLAIN + bytes(4096)),
}


@pytest.mark.parametrize("content", PCDS.values(), ids=PCDS)
def test_pcd_headers_of_other_programs_are_read(tmp_path: Path, content: bytes) -> None:
    np.testing.assert_array_equal(read([put(tmp_path / "a.pcd", content)], CRS).points, POINTS)


def test_what_windows_writes_for_no_number_is_dropped_and_counted(tmp_path: Path) -> None:
    rows = ascii_rows() + "1.#QNAN 1.#IND00 -1.#IND\nnan(ind) -nan(snan) 1.#INF\n-nan NaN nan\n"
    head = f"VERSION 0.7\nFIELDS x y z\n{SIZES}WIDTH 6\nHEIGHT 1\nPOINTS 6\nDATA ascii\n"
    cloud = read([put(tmp_path / "a.pcd", head + rows)], CRS)
    np.testing.assert_array_equal(cloud.points, POINTS)
    assert cloud.dropped == {"not_finite": 3}


BINARY = pcd(PLAINLY + COUNTS, b"")
ASCII = pcd(PLAINLY + COUNTS, b"", "ascii")
FEWER = COUNTS.replace("3", "2")


@pytest.mark.parametrize(
    ("content", "says"),
    [
        (BINARY.replace(b"TYPE F", b"TYPE D") + PLAIN, "'D8' is no type"),
        (BINARY.replace(b"SIZE 8 8 8\nTYPE F F F\n", b"") + PLAIN, "differ in length"),
        (BINARY.replace(b"FIELDS", b"FJELDS") + PLAIN, "'FJELDS x y z' is not known"),
        (BINARY.replace(b"VERSION", b"\x80\x01VERS") + PLAIN, "bytes that are no text"),
        (BINARY.replace(b"x y z", b"x X z") + PLAIN, "it has x twice"),
        (BINARY.replace(b"F F F", b"I I I") + PLAIN, "its x is int64, not one floating point number"),
        (pcd(PLAINLY + COUNTS.replace("0 0 0 1 0", "0 0 0")), "VIEWPOINT is not seven numbers"),
        (BINARY.replace(b"\n", b"\r") + PLAIN, "carriage returns alone"),
        (pcd(PLAINLY + FEWER), "tells of 2 points, at least 1 follow"),
        (pcd(PLAINLY + COUNTS.replace("3", "0")), "tells of 0 points, at least 3 follow"),
        (pcd(PLAINLY + FEWER, ascii_rows(), "ascii"), "tells of 2 points, at least 1 follow"),
        (ASCII + b"1 2 \x80\x03\n" + ascii_rows().encode(), "are no text"),
        (ASCII.decode().encode("utf-16"), "UTF-16"),
    ],
)  # fmt: skip
def test_pcd_headers_that_cannot_be_are_one_line_without_raw_bytes(
    tmp_path: Path, content: bytes, says: str
) -> None:
    assert says in refusal(put(tmp_path / "a.pcd", content))


@pytest.mark.parametrize(
    "pose", ["1.5 2 3 1 0 0 0", "0 0 0 0.7071068 0 0 0.7071068", "500000 4.9e6 nan 1 0 0 0", "0 0 0 0 0 0 1"]
)
def test_a_pose_that_may_have_moved_the_points_is_refused(tmp_path: Path, pose: str) -> None:
    path = put(tmp_path / "a.pcd", pcd(PLAINLY + COUNTS.replace("0 0 0 1 0 0 0", pose)))
    assert f"its VIEWPOINT {pose} is a pose of the sensor" in refusal(path)
    # In the sensor's own axes, as in a folder of scans, nothing has to be moved.
    assert len(open_pcd(path, from_option(CRS), in_sensor_axes=True).records()) == len(POINTS)


def test_the_records_of_a_scan_are_those_of_a_map(tmp_path: Path) -> None:
    plain = f"VERSION 0.7\nFIELDS X Y Z Intensity\nSIZE 8 8 8 4\nTYPE F F F F\n{COUNTS}"
    path = put(tmp_path / "a.pcd", pcd(plain, ascii_rows(after=" 1.#QNAN"), "ascii"))
    table = open_pcd(path, from_option(CRS)).records()
    assert table.dtype.names == ("x", "y", "z", "intensity")
    np.testing.assert_array_equal(np.column_stack([table[axis] for axis in "xyz"]), POINTS)
    put(path, path.read_bytes() + ascii_rows(after=" 7").encode())
    with pytest.raises(UsageError, match="tells of 3 points, at least 3 follow"):
        open_pcd(path, from_option(CRS)).records()


LITTLE = "binary_little_endian"


def ply(form: str, *lines: str, first: str = "ply") -> bytes:
    return "\n".join([first, f"format {form} 1.0", *lines, "end_header", ""]).encode()


DOUBLES = "property double x", "property double y", "property double z"
FACES = "element face 1", "property list uchar int vertex_indices"
PLYS = {
    "CloudCompare": ply(
        LITTLE, "comment Author: CloudCompare", "obj_info Generated by CloudCompare!",
        "element vertex 3", *DOUBLES, "property float scalar_Intensity",
    )
    + records(X, Y, Z, ("i", "<f4")),
    "Open3D": ply("ascii", "comment Created by Open3D", "element vertex 3", *DOUBLES, *FACES)
    + ascii_rows().encode()
    + b"3 0 1 2\n",
    "faces behind": ply(LITTLE, "element vertex 3", *DOUBLES, *FACES) + PLAIN + bytes(13),
    "times": ply(LITTLE, "element vertex 3", *DOUBLES, "property uint64 t")
    + records(X, Y, Z, ("t", "<u8")),
    "capitals": ply(LITTLE, "element vertex 3", *(f"property float64 {name}" for name in "XYZ")) + PLAIN,
    "blank behind the first word": ply(LITTLE, "element vertex 3", *DOUBLES, first="ply ") + PLAIN,
    "mark of UTF-8": b"\xef\xbb\xbf" + ply("ascii", "element vertex 3", *DOUBLES) + ascii_rows().encode(),
}  # fmt: skip


@pytest.mark.parametrize("content", PLYS.values(), ids=PLYS)
def test_ply_headers_of_other_programs_are_read(tmp_path: Path, content: bytes) -> None:
    np.testing.assert_array_equal(read([put(tmp_path / "a.ply", content)], CRS).points, POINTS)


@pytest.mark.parametrize(
    ("content", "says"),
    [
        (ply(LITTLE, "element vertex 3", *DOUBLES).replace(b"\n", b"\r") + PLAIN, "carriage returns"),
        (ply(LITTLE, "element vertex 2", *DOUBLES) + PLAIN, "at least 1 follow"),
        (ply(LITTLE, "element vertex 0", *DOUBLES) + PLAIN, "at least 3 follow"),
        (ply(LITTLE, "element vertex 3", "property \x80\x03 x") + PLAIN, "bytes that are no text"),
        (ply("ascii", "element vertex 3", *DOUBLES).decode().encode("utf-16-le"), "UTF-16"),
    ],
)  # fmt: skip
def test_ply_headers_that_cannot_be_are_one_line_without_raw_bytes(
    tmp_path: Path, content: bytes, says: str
) -> None:
    assert says in refusal(put(tmp_path / "a.ply", content))


@pytest.mark.parametrize("coding", ["utf-16", "utf-16-le", "utf-16-be", "utf-32"])
@pytest.mark.parametrize("head", ["", "x,y,z\n"])
def test_text_of_two_bytes_a_character_is_named(tmp_path: Path, coding: str, head: str) -> None:
    content = (head + ascii_rows().replace(" ", ",")).encode(coding)
    assert "UTF-16, as PowerShell writes it: save it as UTF-8" in refusal(put(tmp_path / "a.csv", content))


@pytest.mark.parametrize("end", ["\x1a", "\x1a\n", "\r\n\x1a"])
def test_the_end_of_a_dos_text_is_none_of_its_points(tmp_path: Path, end: str) -> None:
    cloud = read([put(tmp_path / "a.xyz", ascii_rows().strip() + end)], CRS)
    np.testing.assert_array_equal(cloud.points, POINTS)


def test_text_whose_lines_end_with_carriage_returns_alone_is_named(tmp_path: Path) -> None:
    assert "carriage returns alone" in refusal(put(tmp_path / "a.xyz", ascii_rows().replace("\n", "\r")))


def test_text_with_more_points_than_its_count_is_refused(tmp_path: Path) -> None:
    assert "tells of 2 points, at least 1 follow" in refusal(put(tmp_path / "a.xyz", "2\n" + ascii_rows()))


# ---- LAS -----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["a.las", "a.laz"])
def test_a_header_that_counts_none_of_the_points_behind_it_is_refused(tmp_path: Path, name: str) -> None:
    path = write(tmp_path / name, np.tile(POINTS, (20, 1)))
    data = bytearray(path.read_bytes())
    struct.pack_into("<Q", data, 247, 0)
    path.write_bytes(data)
    assert "tells of 0 points, at least 60 follow" in refusal(path, None)


def test_an_extended_record_of_a_false_length_is_a_damaged_file(tmp_path: Path) -> None:
    path = tmp_path / "a.laz"
    las = laspy.read(write(tmp_path / "b.las", POINTS))
    las.evlrs = laspy.vlrs.vlrlist.VLRList([laspy.VLR("maker", 1000, "of its own", bytes(32))])
    las.write(path)
    assert len(read([path]).points) == len(POINTS)
    data = bytearray(path.read_bytes())
    (at,) = struct.unpack_from("<Q", data, 235)
    for length in (2**40, 2**63, 33):
        struct.pack_into("<Q", data, at + 20, length)
        path.write_bytes(data)
        assert "truncated or corrupt in its last records: copy it again" in refusal(path, None)
    path.write_bytes(data[: at + 25])
    assert "truncated or corrupt in its last records" in refusal(path, None)


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
@pytest.mark.parametrize(
    ("at", "what"), [(131, "scales"), (147, "scales"), (155, "offsets"), (171, "offsets")]
)
def test_scales_and_offsets_that_are_no_numbers_are_named(
    tmp_path: Path, value: float, at: int, what: str
) -> None:
    path = write(tmp_path / "a.las", POINTS)
    data = bytearray(path.read_bytes())
    struct.pack_into("<d", data, at, value)
    path.write_bytes(data)
    assert f"its {what} are " in refusal(path, None)
