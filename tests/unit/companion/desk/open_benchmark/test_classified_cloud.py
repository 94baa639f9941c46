"""Truth of a classified survey: what its classes say, and no more."""

from __future__ import annotations

from pathlib import Path

import laspy
import numpy as np
import pytest
from pyproj import CRS

from companion.desk.open_benchmark.classified_cloud import classified_case
from companion.runtime.errors import UsageError

SIDE = 30.0


def survey(path: Path, all_unclassified: bool = False) -> Path:
    """Write a square of ground with a house, trees, a pond, a slope and a patch without classes."""
    rng = np.random.default_rng(3)
    x, y = rng.uniform(0, SIDE, (2, 20_000))
    z = np.where(x > 24, 0.5 * (x - 24), 0.0) + rng.normal(0, 0.01, len(x))
    classes = np.full(len(x), 2)
    house, trees = (abs(x - 8) < 3) & (abs(y - 8) < 3), (abs(x - 8) < 2) & (abs(y - 20) < 2)
    pond, unsaid = (abs(x - 18) < 2) & (abs(y - 8) < 2), (abs(x - 18) < 2) & (abs(y - 20) < 2)
    for mask, code, height in ((house, 6, 4.0), (trees, 5, 3.0), (pond, 9, -0.1), (unsaid, 1, 0.0)):
        classes[mask], z[mask] = code, z[mask] + height
    if all_unclassified:
        classes[:] = 1
    header = laspy.LasHeader(point_format=6, version="1.4")
    header.scales, header.offsets = np.full(3, 0.001), np.array([500_000.0, 5_200_000.0, 0.0])
    header.add_crs(CRS.from_epsg(32632))
    cloud = laspy.LasData(header)
    cloud.x, cloud.y, cloud.z = x + 500_000.0, y + 5_200_000.0, z + 400.0
    cloud.classification = classes.astype(np.uint8)
    cloud.write(str(path))
    return path


def test_classes_decide_where_they_say_enough(tmp_path: Path) -> None:
    case = classified_case(survey(tmp_path / "town.laz"))
    grid, truth = case.task.grid, case.truth

    def at(x: float, y: float) -> tuple[int, str]:
        row, col, _ = grid.index(np.array(x - SIDE / 2), np.array(y - SIDE / 2))
        kind = int(truth.kind[row, col])
        return int(truth.safe[row, col]), "" if kind == 255 else truth.kinds[kind]

    assert at(13.5, 13.5) == (1, "")
    assert at(8, 11) == (0, "building")  # its edge
    assert at(8, 8) == (255, "")  # its roof
    assert at(8, 20) == (0, "vegetation")
    assert at(18, 8) == (0, "water")
    assert at(18, 20) == (255, "")  # unclassified
    assert at(27, 15) == (0, "slope")
    assert np.isnan(case.flights["town"].sensors_m).all()


def test_a_survey_without_classes_is_refused(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="is it classified"):
        classified_case(survey(tmp_path / "plain.laz", all_unclassified=True))
