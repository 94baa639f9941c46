"""Scales of LAS that are too coarse for the cells or the heights of a map."""

from __future__ import annotations

import logging
from pathlib import Path

import laspy
import numpy as np
import pytest
from pyproj import CRS

from companion.desk.survey.cloud_quality import check_steps
from companion.desk.survey.map_run import run
from companion.runtime.errors import UsageError
from params import Parameters
from tests.unit.companion.desk.survey.clouds import field, placed

DEGREES = (111_320.0, 111_320.0, 1.0)
METRES = (1.0, 1.0, 1.0)


@pytest.mark.parametrize(
    ("scales", "lengths_m", "says"),
    [
        ((1e-4, 1e-4, 1e-3), DEGREES, "11.1 m apart, more than a cell of"),
        ((1e-7, 1e-5, 1e-3), DEGREES, "1.11 m apart"),
        ((1.0, 1.0, 1.0), METRES, "more than a cell"),
        ((1e-3, 1e-3, 1.0), METRES, "heights 1 m apart, more than relief_m"),
        ((1e-7, 1e-7, 1e-2), (111_320.0, 111_320.0, 100.0), "heights 1 m apart"),
    ],
)
def test_steps_beyond_a_cell_or_the_relief_are_refused_by_name(
    scales: tuple[float, float, float], lengths_m: tuple[float, float, float], says: str
) -> None:
    with pytest.raises(UsageError, match="a.las: its scales") as error:
        check_steps("a.las", scales, lengths_m, Parameters())
    assert says in str(error.value)


def test_steps_beyond_a_quarter_of_a_cell_are_told(caplog: pytest.LogCaptureFixture) -> None:
    with caplog.at_level(logging.WARNING):
        check_steps("a.las", (1e-7, 1e-7, 1e-2), DEGREES, Parameters())
        check_steps("a.ply", (0.0, 0.0, 0.0), DEGREES, Parameters())
        assert not caplog.messages
        check_steps("a.las", (1e-6, 1e-6, 1e-2), DEGREES, Parameters())
    assert "0.111 m apart: write finer ones" in caplog.messages[0]


@pytest.mark.parametrize("mode", ["default", "source"])
def test_a_geographic_cloud_of_coarse_scales_is_not_mapped(tmp_path: Path, mode: str) -> None:
    points = placed(field(1.0), "EPSG:4326")
    header = laspy.LasHeader(point_format=6, version="1.4")
    header.scales, header.offsets = np.array([1e-4, 1e-4, 1e-3]), np.floor(points.min(axis=0))
    header.add_crs(CRS("EPSG:4326"))
    las = laspy.LasData(header)
    las.x, las.y, las.z = points.T
    las.write(tmp_path / "a.las")
    with pytest.raises(UsageError, match=r"its scales 0\.0001, 0\.0001, 0\.001 put x and y 11\.1 m apart"):
        run([tmp_path / "a.las"], tmp_path / "out", Parameters(mode=mode), lambda *_: None)
