"""Truth raster: files of another library are read or refused."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rasterio
from rasterio import Affine

from companion.desk.truth_raster import read_raster

VALUES = np.arange(7 * 5, dtype=np.uint8).reshape(7, 5)


def written(path: Path, **given: Any) -> Path:
    own: dict[str, Any] = {"dtype": "uint8", "crs": "EPSG:32632", **given}
    place = Affine(0.5, 0.0, -3.0, 0.0, -0.5, 9.0)
    with rasterio.open(path, "w", "GTiff", width=5, height=7, count=1, transform=place, **own) as file:
        file.write(VALUES.astype(own["dtype"]), 1)
    return path


@pytest.mark.parametrize("given", [{}, {"compress": "deflate"}, {"compress": "deflate", "blockysize": 2}])
def test_bytes_are_read_plain_or_deflated(tmp_path: Path, given: dict[str, Any]) -> None:
    raster = read_raster(written(tmp_path / "a.tif", **given))
    assert np.array_equal(raster.values, VALUES)
    assert raster[1:] == (-3.0, 9.0, 0.5)


@pytest.mark.parametrize("given", [{"dtype": "float32"}, {"compress": "lzw"}, {"BIGTIFF": "YES"}])
def test_other_rasters_are_refused(tmp_path: Path, given: dict[str, Any]) -> None:
    with pytest.raises(ValueError, match=r"does not hold bytes|no little-endian TIFF"):
        read_raster(written(tmp_path / "a.tif", **given))


@pytest.mark.parametrize("size", [0, 6, 20, 40, 200])
def test_a_truncated_file_is_refused(tmp_path: Path, size: int) -> None:
    path = written(tmp_path / "a.tif", compress="deflate")
    path.write_bytes(path.read_bytes()[:size])
    with pytest.raises(ValueError, match="raster|TIFF|reshape"):
        read_raster(path)
