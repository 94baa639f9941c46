"""Windowed writing of maps: the window's size is independent of the survey's, and changes no byte."""

from __future__ import annotations

import io
import tracemalloc
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import matplotlib.image
import numpy as np
import pytest
import rasterio
from numpy.typing import NDArray

from companion.desk.clouds.crs import from_option
from companion.desk.survey import geotiff, overview
from companion.desk.survey.local_metres import Metric, metric_for
from params import Parameters
from slz import UNKNOWN, Box, Grid

METRIC: Metric = metric_for(from_option("EPSG:32632"), np.full(3, 5e5), np.full(3, 5.001e5), 0.5)
MOST = 1024 * 4096  # cells read at a time


@dataclass
class Patches:
    """Ground at the west and the east end of a map, and nothing between."""

    rows: int
    cols: int
    asked: list[Box] = field(default_factory=list)

    @property
    def grid(self) -> Grid:
        return Grid(0.0, 0.0, 0.5, self.rows, self.cols)

    def read(self, name: str, box: Box) -> NDArray[Any]:
        self.asked.append(box)
        row, col = np.ogrid[box.row0 : box.row1, box.col0 : box.col1]
        seen = (col < 300) | (col >= self.cols - 70)
        if name == "state":
            return np.where(seen, (row + col) % 2, UNKNOWN).astype(np.uint8)
        if name == "surface":
            return np.where(seen, 1 + (row + col) % 5, 0).astype(np.uint8)
        return np.where(seen, row % 251 + col % 13, np.nan).astype(np.float32)


def test_no_map_is_read_in_windows_that_grow_with_it(tmp_path: Path) -> None:
    maps = Patches(1500, 20_000)
    for layer in (geotiff.rasters(METRIC, "default")[k] for k in (0, -1)):
        geotiff.write(tmp_path / "a.tif", layer, maps, METRIC)
    overview.ground_png(maps, overview.water_mask(maps, Parameters()))
    assert max(rows * cols for rows, cols in (box.shape for box in maps.asked)) <= MOST


@pytest.mark.parametrize(("rows", "cols"), [(1500, 5000), (40, 200), (300, 700)])
def test_the_windows_change_no_byte(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, rows: int, cols: int
) -> None:
    maps, found = Patches(rows, cols), []
    for wide in (10**6, 512):
        monkeypatch.setattr(geotiff, "WIDE", wide)
        monkeypatch.setattr(overview, "WIDE", wide)
        paths = [
            geotiff.write(tmp_path / f"{layer.name}.tif", layer, maps, METRIC)
            for layer in geotiff.rasters(METRIC, "default")
        ]
        found.append(
            [path.read_bytes() for path in paths]
            + [overview.ground_png(maps, overview.water_mask(maps, Parameters()))]
        )
    assert found[0] == found[1]
    with rasterio.open(tmp_path / "safe.tif") as file:
        np.testing.assert_array_equal(file.read(1)[::-1], maps.read("state", maps.grid.everything))


class Lake(Patches):
    """Ground whose middle holds no return, or returns that may be water, where the survey says so."""

    def read(self, name: str, box: Box) -> NDArray[Any]:
        found = super().read(name, box)
        return np.where(found >= 0, 0, 0.9).astype(np.float32) if name == "water" else found


@pytest.mark.parametrize(
    ("maps", "meaning"), [(Patches(40, 600), "unknown"), (Lake(40, 600), "may be water")]
)
def test_the_legend_has_the_colours_of_the_picture(maps: Patches, meaning: str) -> None:
    picture = matplotlib.image.imread(
        io.BytesIO(overview.ground_png(maps, overview.water_mask(maps, Parameters())))
    )
    colour = "#" + bytes(np.round(255 * picture[20, 400, :3]).astype(int).tolist()).hex()
    assert overview.legend()[colour].startswith(meaning)


def test_a_picture_keeps_nothing_of_the_cells_that_it_leaves_out() -> None:
    maps = Patches(1 << 16, 1024)
    tracemalloc.start()
    small = overview.subsampled(maps, "state", 64)
    _, most = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert small.shape == (1024, 16)
    assert most < maps.rows * maps.cols / 2
    some = Box(2048, 4096, 0, 1024)
    np.testing.assert_array_equal(small[32:64], maps.read("state", some)[::64, ::64])
