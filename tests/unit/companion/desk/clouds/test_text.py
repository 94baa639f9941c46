"""Text clouds of real programs: decimal commas, counts, quotes, units in names, words beside the numbers."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

import numpy as np
import pytest

from companion.desk.clouds.cloud import read
from companion.runtime.errors import UsageError
from tests.unit.companion.desk.survey.clouds import field, placed

CRS = "EPSG:32610"
POINTS = placed(field(5.0), CRS).round(3)


def rows(form: str, points: np.ndarray = POINTS) -> list[str]:
    """Return one line a point; the form's numbers have three decimals."""
    return [form.format(x=f"{x:.3f}", y=f"{y:.3f}", z=f"{z:.3f}") for x, y, z in points]


def comma(lines: Iterable[str]) -> list[str]:
    return [line.replace(".", ",") for line in lines]


READ = {
    "semicolons.csv": comma(rows("{x};{y};{z}")),
    "named.csv": ["X;Y;Z", *comma(rows("{x};{y};{z}"))],
    "tabs.txt": comma(rows("{x}\t{y}\t{z}")),
    "spaces.xyz": comma(rows("{x} {y} {z}")),
    "commas in quotes.csv": comma(rows('"{x}";"{y}";"{z}"')),
    "comma later.csv": ["1000;2000;100", *comma(rows("{x};{y};{z}"))],
    "count.xyz": [str(len(POINTS)), *rows("{x} {y} {z} 12 66 107 172")],
    "cloudcompare.asc": ["//X Y Z Intensity R G B", str(len(POINTS)), *rows("{x} {y} {z} 12 66 107 172")],
    "brackets.csv": ["X[m],Y[m],Z[m]", *rows("{x},{y},{z}")],
    "round.csv": ["Easting (m),Northing (m),Elevation (metres)", *rows("{x},{y},{z}")],
    "paraview.csv": ['"intensity","Points:0","Points:1","Points:2"', *rows("12,{x},{y},{z}")],
    "quoted.csv": ['"X","Y","Z","Class"', *rows('"{x}","{y}","{z}","2"')],
    "class.csv": ["x,y,z,class", *rows("{x},{y},{z},ground")],
    "unnamed class.csv": rows("{x},{y},{z},ground"),
    "date.csv": ["time,easting,northing,elevation", *rows("2024-05-01 10:00:00,{x},{y},{z}")],
    "date.txt": ["time\tx\ty\tz", *rows("2024-05-01 10:00:00\t{x}\t{y}\t{z}")],
    "extra commas.csv": ["x,y,z,name", *rows("{x},{y},{z},ground, road")],
    "words with commas.csv": ["x;y;z;name", *rows("{x};{y};{z};ground, road")],
}


def put(folder: Path, name: str, lines: list[str]) -> Path:
    path = folder / name
    path.write_text("\n".join(lines) + "\n", "utf-8")
    return path


@pytest.mark.parametrize("name", READ)
def test_points_are_read_to_the_last_digit(tmp_path: Path, name: str) -> None:
    expected = np.vstack([[[1000, 2000, 100]], POINTS]) if name == "comma later.csv" else POINTS
    cloud = read([put(tmp_path, name, READ[name])], CRS)
    np.testing.assert_array_equal(cloud.points, expected)


@pytest.mark.parametrize(
    ("lines", "says"),
    [
        (comma(rows("{x}, {y}, {z}")), "decimal commas, and commas between its columns"),
        ([line.replace(".", ",") for line in rows("{x},{y},{z}")] + ["1,002,3,004,5,006"], "decimal commas"),
        (comma(rows("{x};{y};{z}")) + rows("{x};{y};{z}"), "decimal commas and decimal points"),
        ([str(len(POINTS) + 1), *rows("{x} {y} {z}")], f"truncated, {len(POINTS)} of {len(POINTS) + 1}"),
        (["x,y,z,class", *rows("{x},{y},{z},2"), "1,2,high,2"], "'1,2,high,2' is no point"),
        (["x,y,z[ft]", *rows("{x},{y},{z}")], "ft by its column 'z[ft]', but m by EPSG:32610: name the unit"),
        (
            ["x[ft],y,z", *rows("{x},{y},{z}")],
            "ft by its column 'x[ft]', but m by EPSG:32610: name the right",
        ),
    ],
)
def test_what_cannot_be_told_is_refused(tmp_path: Path, lines: list[str], says: str) -> None:
    path = put(tmp_path, "a.csv", lines)
    with pytest.raises(UsageError) as caught:
        read([path], CRS)
    assert says in str(caught.value)
    assert str(caught.value).startswith(f"{path}: ")


def test_the_option_settles_the_unit_that_a_name_tells(tmp_path: Path) -> None:
    path = put(tmp_path, "a.csv", ["x,y,z[ft]", *rows("{x},{y},{z}")])
    assert read([path], CRS, vertical_unit="ft").reference.vertical_m == 0.3048


def test_whole_numbers_between_commas_are_what_they_are(tmp_path: Path) -> None:
    path = put(tmp_path, "a.csv", ["500000,4900000,100,12,0,107", "500001,4900000,100,12,66,0"])
    assert read([path], CRS).points.tolist() == [[500000, 4900000, 100], [500001, 4900000, 100]]


def test_columns_in_degrees_without_names_are_refused_for_latitude_may_come_first(tmp_path: Path) -> None:
    lines = [f"{70 + k * 1e-5} {10 + k * 1e-5} {z}" for k, z in enumerate((100.0, 100.5, 101.0))]
    with pytest.raises(UsageError, match="longitude or latitude may come first; begin the file with a line"):
        read([put(tmp_path, "degrees.txt", lines)], "EPSG:4326")
    cloud = read([put(tmp_path, "named.txt", ["lat lon z", *lines])], "EPSG:4326")
    assert len(cloud.points) == 3
