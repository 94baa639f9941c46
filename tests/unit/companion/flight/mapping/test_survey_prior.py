"""Prior from a survey's rasters: rotated against north, and beyond the projection's area."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
import rasterio
from affine import Affine
from pyproj import CRS, Transformer

import params
from companion.flight.mapping.survey_prior import SurveyPrior
from slz import SAFE, LocalFrame

SIDE_M, CELL_M = 640.0, 0.5


def survey(folder: Path, epsg: int, x: float, y: float) -> SurveyPrior:
    """Return level ground about a place, of which every other row of 0.5 m is unsafe."""
    n = int(SIDE_M / CELL_M)
    place = Affine(CELL_M, 0.0, x - SIDE_M / 2, 0.0, -CELL_M, y + SIDE_M / 2)
    for name, dtype, value, nodata in (
        ("safe", "uint8", 1, 255),
        ("dsm", "float32", 100, np.nan),
        ("slope", "float32", 0.5, np.nan),
    ):
        values = np.full((n, n), value, dtype)
        if name == "safe":
            values[::2] = 0
        form = {"driver": "GTiff", "height": n, "width": n, "count": 1, "dtype": dtype, "nodata": nodata}
        with rasterio.open(folder / f"{name}.tif", "w", crs=f"EPSG:{epsg}", transform=place, **form) as file:
            file.write(values, 1)
    told = {
        "crs": CRS.from_epsg(epsg).to_wkt(),
        "vertical_unit_m": 1.0,
        "cells": {"cell_m": CELL_M},
        "parameters": {"footprint_m": 10, "relief_m": 0.01, "safe_slope_deg": 1},
    }
    (folder / "survey.json").write_text(json.dumps(told))
    return SurveyPrior(folder, params.load("quadcopter", []))


@pytest.mark.parametrize("turned_deg", [0.0, 45.0, 90.0, 180.0])
def test_a_cell_is_safe_only_where_all_around_is_however_the_survey_is_turned(
    tmp_path: Path, turned_deg: float
) -> None:
    """A polar grid's rows run to another side at each longitude; a cell of 1 m lies over two at least."""
    lat, lon = 70.0, -45.0 + turned_deg
    x, y = Transformer.from_crs(4326, 3413, always_xy=True).transform(lon, lat)
    found = survey(tmp_path, 3413, x, y)(LocalFrame(lat, lon, 100.0), np.zeros(3))
    assert found is not None
    assert np.isfinite(found.height_m).mean() > 0.9
    assert not (found.state == SAFE).any()


@pytest.mark.parametrize(("lat", "lon"), [(-5.7, -83.39), (0.0, -81.0), (1.0, 99.0), (46.95, -81.0)])
def test_a_place_that_the_survey_s_projection_does_not_reach_is_off_the_survey(
    tmp_path: Path, lat: float, lon: float
) -> None:
    assert survey(tmp_path, 32632, 500_000, 5_200_000)(LocalFrame(lat, lon, 500.0), np.zeros(3)) is None
