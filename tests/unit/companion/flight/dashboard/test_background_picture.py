"""The background picture: markers at known places against pymap3d, and the files that are refused."""

from __future__ import annotations

import io
import math
import sqlite3
from pathlib import Path
from typing import Any

import numpy as np
import pymap3d
import pytest
import rasterio
from PIL import Image
from rasterio import Affine
from rasterio.warp import transform

from companion.flight.dashboard.background_picture import SIDE, UNIT_M, BackgroundPicture
from companion.runtime.errors import UsageError
from slz.frame import LocalFrame

HOME = 59.9, 10.7
FRAME = LocalFrame(59.9031, 10.7042, 4500.0)  # 420 m from the middle of the pictures
# Colour of each marker, and its place from the picture's middle, degrees north and east.
MARKERS = {(255, 0, 0): (0.0002, 0.0004), (0, 255, 0): (-0.00015, 0.0003), (0, 0, 255): (0.0001, -0.0004)}
MERCATOR_M = 6_378_137.0 * math.pi
ZOOM = 19


def drawn(width: int, height: int, places: dict[Any, tuple[float, float]]) -> np.ndarray[Any, Any]:
    """Return a grey picture with round markers of colours around places (column, row; of pixels' edges)."""
    rgb = np.full((height, width, 3), 40.0)
    row, col = np.mgrid[:height, :width] + 0.5
    for colour, (x, y) in places.items():
        weight = np.exp(-((col - x) ** 2 + (row - y) ** 2) / 128)[..., None]
        rgb = rgb * (1 - weight) + np.array(colour) * weight
    return np.moveaxis(rgb, -1, 0).astype(np.uint8)


def geotiff(path: Path, crs: str, pixel: float, **more: Any) -> Path:
    """Write a picture of 800 x 700 pixels around `HOME`, of a size in the CRS's unit."""
    (x,), (y,) = transform("EPSG:4326", crs, [HOME[1]], [HOME[0]])
    place = Affine(pixel, 0, x - 400 * pixel, 0, -pixel, y + 350 * pixel)
    places = {}
    for colour, (north, east) in MARKERS.items():
        (east,), (north,) = transform("EPSG:4326", crs, [HOME[1] + east], [HOME[0] + north])
        places[colour] = (east - place.c) / pixel, (place.f - north) / pixel
    shape = {"width": 800, "height": 700, "count": 3, "dtype": "uint8", "driver": "GTiff"}
    with rasterio.open(path, "w", crs=crs, transform=place, photometric="RGB", **shape | more) as file:
        file.write(drawn(800, 700, places))
    return path


def mercator(lat_deg: float, lon_deg: float) -> tuple[float, float]:
    """Return column and row in pixels of the world at `ZOOM`, from its north-western corner."""
    north = math.asinh(math.tan(math.radians(lat_deg))) / math.pi
    return ((lon_deg / 360 + 0.5) * 256 * 2**ZOOM, (1 - north) / 2 * 256 * 2**ZOOM)


def mbtiles(path: Path, kind: str = "png") -> Path:
    """Write tiles (MBTiles 1.3: rows from the south) around `HOME`."""
    x0, y0 = (int(v // 256) - 1 for v in mercator(*HOME))
    places = {
        colour: (x - 256 * x0, y - 256 * y0)
        for colour, (north, east) in MARKERS.items()
        for x, y in [mercator(HOME[0] + north, HOME[1] + east)]
    }
    picture = np.moveaxis(drawn(768, 768, places), 0, -1)
    with sqlite3.connect(path) as db:
        db.execute("CREATE TABLE metadata (name text, value text)")
        db.execute("CREATE TABLE tiles (zoom_level int, tile_column int, tile_row int, tile_data blob)")
        db.executemany("INSERT INTO metadata VALUES (?, ?)", [("name", "x"), ("format", kind)])
        for col in range(3):
            for row in range(3):
                data = io.BytesIO()
                part = picture[256 * row : 256 * row + 256, 256 * col : 256 * col + 256]
                Image.fromarray(part).save(data, "png" if kind == "pbf" else kind)
                blob = b"\x1f\x8b" + bytes(20) if kind == "pbf" else data.getvalue()
                place = ZOOM, x0 + col, 2**ZOOM - 1 - (y0 + row)
                db.execute("INSERT INTO tiles VALUES (?, ?, ?, ?)", (*place, blob))
    db.close()
    return path


def tile(picture: BackgroundPicture, level: int, row: int, col: int) -> np.ndarray[Any, Any]:
    return np.asarray(Image.open(io.BytesIO(picture.tile(FRAME, level, row, col))).convert("RGBA")).astype(
        float
    )


def errors_m(picture: BackgroundPicture, level: int) -> list[float]:
    """Return how far each marker is drawn from where it is."""
    found, cell_m = [], UNIT_M * 2.0**level
    size_m = SIDE * cell_m
    for colour, (north, east) in MARKERS.items():
        e, n, _ = pymap3d.geodetic2enu(
            HOME[0] + north, HOME[1] + east, FRAME.alt_m, FRAME.lat_deg, FRAME.lon_deg, FRAME.alt_m
        )
        first_row, first_col = int((n - 20) // size_m), int((e - 20) // size_m)
        mosaic = np.vstack(
            [
                np.hstack([tile(picture, level, first_row + r, first_col + c) for c in (0, 1)])
                for r in (1, 0)  # a tile further north is higher in the picture
            ]
        )
        weight = np.clip(mosaic[..., :3] @ (np.array(colour) / 127.5 - 1) - 60, 0, None)
        row, col = np.mgrid[: 2 * SIDE, : 2 * SIDE] + 0.5
        east_m = first_col * size_m + (weight * col).sum() / weight.sum() * cell_m
        north_m = (first_row + 2) * size_m - (weight * row).sum() / weight.sum() * cell_m
        found.append(math.hypot(east_m - e, north_m - n))
    return found


@pytest.mark.parametrize(
    ("crs", "pixel", "more"),
    [
        ("EPSG:32632", 0.1, {}),
        ("EPSG:32633", 0.1, {"tiled": True, "compress": "deflate"}),  # its north is 4 degrees off
        ("EPSG:4326", 1.5e-6, {}),
    ],
)
def test_markers_of_a_geotiff_lie_where_they_are(tmp_path: Path, crs: str, pixel: float, more: Any) -> None:
    picture = BackgroundPicture(geotiff(tmp_path / "a.tif", crs, pixel, **more))
    assert max(errors_m(picture, 0)) < 0.1
    with rasterio.open(tmp_path / "a.tif", "r+") as file:
        file.build_overviews([2, 4, 8], rasterio.enums.Resampling.average)
    assert max(errors_m(BackgroundPicture(tmp_path / "a.tif"), 1)) < 0.2


def test_markers_of_mbtiles_lie_where_they_are(tmp_path: Path) -> None:
    assert max(errors_m(BackgroundPicture(mbtiles(tmp_path / "a.mbtiles")), 0)) < 0.15


def small(path: Path, bands: list[float], *, dtype: str = "uint8", pixel_m: float = 1.0, **more: Any) -> Path:
    """Write 64 x 64 pixels of one colour, north-east of the frame's origin."""
    (x,), (y,) = transform("EPSG:4326", "EPSG:32632", [FRAME.lon_deg], [FRAME.lat_deg])
    colours = more.pop("colours", None)
    how = {"driver": "GTiff", "dtype": dtype, "crs": "EPSG:32632", "width": 64, "height": 64} | more
    place = Affine(pixel_m, 0, x, 0, -pixel_m, y + 64 * pixel_m)
    with rasterio.open(path, "w", **{"count": len(bands), "transform": place} | how) as file:
        file.write(np.broadcast_to(np.array(bands, dtype)[:, None, None], (len(bands), *file.shape)))
        if colours:
            file.write_colormap(1, colours)
    return path


@pytest.mark.parametrize(
    ("bands", "more", "colour"),
    [
        ([200, 100, 50], {"photometric": "RGB"}, (200, 100, 50, 255)),
        ([200, 100, 50, 255], {"photometric": "RGB", "alpha": "YES"}, (200, 100, 50, 255)),
        ([200, 100, 50, 0], {"photometric": "RGB", "alpha": "YES"}, (None, None, None, 0)),
        ([200, 100, 50, 7, 9], {"photometric": "RGB"}, (200, 100, 50, 255)),  # and infrared
        ([90], {}, (90, 90, 90, 255)),
        ([90], {"nodata": 90}, (None, None, None, 0)),
        ([3], {"colours": {3: (20, 160, 240, 255)}}, (20, 160, 240, 255)),
    ],
)
def test_kinds_of_pixels(tmp_path: Path, bands: list[float], more: Any, colour: Any) -> None:
    picture = BackgroundPicture(small(tmp_path / "a.tif", bands, **more))
    seen = tile(picture, 3, 0, 0)
    for value, wanted in zip(seen[SIDE - 20, 20], colour, strict=True):
        assert wanted is None or value == pytest.approx(wanted, abs=6)
    assert seen[SIDE - 20, 90, 3] == 0  # beside it nothing is drawn


@pytest.mark.parametrize("dtype", ["uint16", "int16"])
def test_sixteen_bits_are_spread_over_the_range_that_is_used(tmp_path: Path, dtype: str) -> None:
    path = small(tmp_path / "a.tif", [0], dtype=dtype)
    with rasterio.open(path, "r+") as file:
        file.write(np.tile(np.where(np.arange(64) < 32, 3000, 5000), (64, 1)).astype(dtype), 1)
    seen = tile(BackgroundPicture(path), 3, 0, 0)[SIDE - 20]
    assert seen[10, 0] < 10
    assert seen[50, 0] > 245


@pytest.mark.parametrize("level", range(-1, 6))
def test_nothing_is_drawn_beside_the_picture(tmp_path: Path, level: int) -> None:
    picture = BackgroundPicture(small(tmp_path / "a.tif", [200, 100, 50]))
    covered_m2 = sum((tile(picture, level, row, col)[..., 3] > 0).sum() for row in (-1, 0) for col in (-1, 0))
    covered_m2 *= (UNIT_M * 2.0**level) ** 2
    assert covered_m2 == pytest.approx(min(64, SIDE * UNIT_M * 2.0**level) ** 2, rel=0.05)


def test_a_picture_on_another_side_of_the_earth_has_no_place(tmp_path: Path) -> None:
    picture = BackgroundPicture(small(tmp_path / "a.tif", [9]))
    assert picture.place(FRAME)["box_m"] == pytest.approx([-1, -1, 66, 66], abs=3)
    assert picture.place(LocalFrame(-40.0, -170.0, 0.0))["box_m"] is None


def refused(path: Path) -> str:
    """Return why a file cannot be the background: one line that names it."""
    with pytest.raises(UsageError) as error:
        BackgroundPicture(path)
    line = str(error.value)
    assert line.startswith(f"{path}: ")
    assert "\n" not in line
    return line


def test_files_that_cannot_be_the_background_are_refused_in_one_line(tmp_path: Path) -> None:
    path = tmp_path / "a.tif"
    assert "no coordinate system" in refused(small(path, [1, 2, 3], crs=None))
    Image.new("RGB", (90, 60)).save(path)
    assert "no coordinate system" in refused(path)
    assert "pixels are float32" in refused(small(path, [1.0], dtype="float32"))
    assert "cannot be read as GeoTIFF" in refused(tmp_path / "none.tif")
    whole = small(path, [1, 2, 3], width=64, height=64).read_bytes()
    path.write_bytes(whole[: len(whole) // 2])
    assert "cannot be read as GeoTIFF" in refused(path)
    path.write_bytes(b"")
    assert "cannot be read as GeoTIFF" in refused(path)
    assert "vector tiles" in refused(mbtiles(tmp_path / "a.mbtiles", "pbf"))
    photo = tmp_path / "photo.jpg"
    Image.new("RGB", (90, 60)).save(photo)
    assert "cannot be read as GeoTIFF" in refused(photo)
    photo.with_suffix(".jgw").write_text("0.1\n0\n0\n-0.1\n597000\n6640000\n")
    assert "cannot be read as GeoTIFF" in refused(photo)
    (tmp_path / "a.vrt").write_text("<VRTDataset><WMS>http://example.org</WMS></VRTDataset>")
    assert "cannot be read as GeoTIFF" in refused(tmp_path / "a.vrt")


def test_a_huge_picture_needs_overviews(tmp_path: Path) -> None:
    path, side = tmp_path / "a.tif", 60_000
    how = {"driver": "GTiff", "count": 3, "dtype": "uint8", "crs": "EPSG:32632", "sparse_ok": True}
    place = Affine(0.05, 0, 597_000, 0, -0.05, 6_640_000)
    with rasterio.open(path, "w", width=side, height=512, transform=place, tiled=True, **how):
        pass
    assert "60000 x 512 pixels" in refused(path)
    with rasterio.open(path, "r+") as file:
        file.build_overviews([8], rasterio.enums.Resampling.nearest)
    assert BackgroundPicture(path).place(FRAME)["finest"] == -1
