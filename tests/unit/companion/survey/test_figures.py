"""Pictures are written whatever the maps hold, and show what they are told to."""

from __future__ import annotations

from pathlib import Path

import matplotlib.image
import numpy as np
import pytest
from matplotlib.colors import to_rgb
from numpy.typing import NDArray

from companion import figures
from companion.figures.furniture import CHOSEN
from companion.figures.layers import CERTAIN, LESS_CERTAIN, UNCERTAIN
from companion.survey.cloud import Cloud
from companion.survey.reference import from_option
from companion.survey.survey import Survey, survey
from params import load
from slz import TerrainMaps, Zone
from tests.unit.companion.survey.clouds import field, placed


@pytest.fixture(scope="module")
def found() -> Survey:
    points = placed(field(), "EPSG:32610")
    cloud = Cloud(points, None, from_option("EPSG:32610"), len(points), {})
    return survey(cloud, load("quadcopter", ["cell_m=0.5"]))


def share_of(path: Path, colour: str) -> float:
    """Return the share of pixels of nearly this colour, shading apart."""
    pixels = matplotlib.image.imread(path)[..., :3].astype(np.float64)
    wanted = np.array(to_rgb(colour))
    level = pixels.sum(axis=-1, keepdims=True) / wanted.sum()
    return float((np.abs(pixels - level * wanted).max(axis=-1) < 0.03).mean())


def with_certainty(zone: Zone, certainty: float) -> Zone:
    from dataclasses import replace

    return replace(zone, certainty=certainty)


@pytest.mark.parametrize(("certainty", "colour"), [(0.9, CERTAIN), (0.6, LESS_CERTAIN), (0.3, UNCERTAIN)])
def test_zones_have_the_colour_of_their_certainty(
    found: Survey, tmp_path: Path, certainty: float, colour: str
) -> None:
    zones = [with_certainty(zone, certainty) for zone in found.report.zones]
    figures.save_terrain(tmp_path / "a.png", found.maps, "safe", "A field", zones)
    shares = {c: share_of(tmp_path / "a.png", c) for c in (CERTAIN, LESS_CERTAIN, UNCERTAIN)}
    assert max(shares, key=shares.__getitem__) == colour
    assert shares[colour] > 0.3


def test_a_flight_is_drawn_over_every_map(found: Survey, tmp_path: Path) -> None:
    path: NDArray[np.float64] = np.linspace([-20.0, -10, 20], [20, 10, 0], 50)
    kept = path.copy()
    paths = figures.save_flight(
        tmp_path / "new", found.maps, found.report.zones, path, path[-1] + 1, path[-1], found.parameters
    )
    assert [p.name for p in paths] == ["dsm.png", "slope.png", "safe.png"]
    np.testing.assert_array_equal(path, kept)
    without = figures.save_flight(tmp_path / "bare", found.maps, found.report.zones, None, None, None)
    assert share_of(paths[2], CHOSEN) > share_of(without[2], CHOSEN)


@pytest.mark.parametrize("shape", [(1, 1), (3, 200), (300, 2)])
def test_maps_of_any_shape_and_without_data_are_drawn(
    found: Survey, tmp_path: Path, shape: tuple[int, int]
) -> None:
    from slz import UNKNOWN, Box

    blank = np.full(shape, np.nan, np.float32)
    state = np.full(shape, UNKNOWN, np.uint8)
    box = Box(0, shape[0], 0, shape[1])
    maps = TerrainMaps(found.maps.frame, found.maps.grid, box, blank, blank, blank, blank, state)
    for path in figures.save_maps(tmp_path, maps):
        assert matplotlib.image.imread(path).shape[0] > 100


def test_a_large_map_is_thinned_and_its_zones_stay_in_place(
    found: Survey, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("companion.figures.picture.MOST_PIXELS", 30)
    figures.save_terrain(tmp_path / "thin.png", found.maps, "safe", "", found.report.zones)
    assert share_of(tmp_path / "thin.png", CERTAIN) > 0.3
