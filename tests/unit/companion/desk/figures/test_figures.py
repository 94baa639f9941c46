"""Pictures of any maps, and their contents."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import matplotlib.image
import numpy as np
import pytest
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from numpy.typing import NDArray

from companion.desk import figures
from companion.desk.clouds.cloud import GeoreferencedCloud
from companion.desk.clouds.crs import from_option
from companion.desk.figures.layer_figures import CERTAIN, LESS_CERTAIN, UNCERTAIN, draw_numbers
from companion.desk.figures.picture import CHOSEN, Marks, Picture, draw_frame
from companion.desk.survey.cloud_survey import CloudSurvey, survey
from params import load
from slz import UNKNOWN, Box, TerrainMaps, Zone
from slz.terrain.layers import NAMED
from tests.unit.companion.desk.survey.clouds import field, placed


@pytest.fixture(scope="module")
def found() -> CloudSurvey:
    points = placed(field(), "EPSG:32610")
    cloud = GeoreferencedCloud(points, None, from_option("EPSG:32610"), len(points), {})
    return survey(cloud, load("quadcopter", ["cell_m=0.5"]))


def share_of(path: Path, colour: str) -> float:
    """Return the share of pixels of nearly this colour, shading apart."""
    pixels = matplotlib.image.imread(path)[..., :3].astype(np.float64)
    wanted = np.array(to_rgb(colour))
    level = pixels.sum(axis=-1, keepdims=True) / wanted.sum()
    return float((np.abs(pixels - level * wanted).max(axis=-1) < 0.03).mean())


def moved(zone: Zone, rows: int, cols: int) -> Zone:
    """Return a zone without its first rows and columns."""
    box = replace(zone.box, row0=zone.box.row0 + rows, col0=zone.box.col0 + cols)
    return replace(zone, box=box, cells=zone.cells[rows:, cols:])


@pytest.mark.parametrize(("certainty", "colour"), [(0.9, CERTAIN), (0.6, LESS_CERTAIN), (0.3, UNCERTAIN)])
def test_zones_have_the_colour_of_their_certainty(
    found: CloudSurvey, tmp_path: Path, certainty: float, colour: str
) -> None:
    zones = [replace(zone, certainty=certainty) for zone in found.report.zones]
    figures.save_terrain(tmp_path / "a.png", found.maps, "safe", "A field", zones)
    shares = {c: share_of(tmp_path / "a.png", c) for c in (CERTAIN, LESS_CERTAIN, UNCERTAIN)}
    assert max(shares, key=shares.__getitem__) == colour
    assert shares[colour] > 0.3


@pytest.mark.parametrize(("away_m", "beside"), [(0.0, True), (0.3, True), (10.0, False)])
def test_the_star_of_the_chosen_point_does_not_hide_the_zone_s_number(
    found: CloudSurvey, away_m: float, beside: bool
) -> None:
    (zone,) = found.report.zones
    chosen = zone.best.enu_m + np.array([away_m, 0.0, 0.0])
    axes = Figure().add_subplot()
    picture = Picture(found.maps, (zone,), found.parameters)
    draw_numbers(axes, picture, Marks(chosen_enu_m=chosen, take_off_enu_m=zone.best.enu_m + 15.0))
    (number,) = axes.texts
    assert number.get_text() == str(zone.id)
    assert (number.get_position() != (0, 0)) == beside


def test_no_number_covers_that_of_a_better_zone(found: CloudSurvey) -> None:
    (zone,) = found.report.zones
    places = np.random.default_rng(3).uniform(-8, 8, (40, 2))
    best = [replace(zone.best, enu_m=np.array([*place, 0.0])) for place in places]
    zones = tuple(replace(zone, id=k, best=one) for k, one in enumerate(best, start=1))
    figure = Figure(figsize=(10.0, 7.4), dpi=130, layout="constrained")
    axes = figure.add_subplot()
    picture = Picture(found.maps, zones, found.parameters)
    draw_numbers(axes, picture, Marks(chosen_enu_m=best[0].enu_m))
    draw_frame(axes, picture, "Numbers")
    figure.draw_without_rendering()
    boxes = [text.get_window_extent() for text in axes.texts if text.get_text().isdigit()]
    assert axes.texts[0].get_text() == "1"
    assert 3 < len(boxes) < 40
    assert not any(one.overlaps(other) for k, one in enumerate(boxes) for other in boxes[:k])


def test_a_flight_is_drawn_over_every_map(found: CloudSurvey, tmp_path: Path) -> None:
    path: NDArray[np.float64] = np.linspace([-20.0, -10, 20], [20, 10, 0], 50)
    kept = path.copy()
    paths = figures.save_flight(
        tmp_path / "new", found.maps, found.report.zones, path, path[-1] + 1, path[-1], found.parameters
    )
    assert {"dsm.png", "slope.png"} < {p.name for p in paths}
    assert paths[-1].name == "safe.png"
    np.testing.assert_array_equal(path, kept)
    without = figures.save_flight(tmp_path / "bare", found.maps, found.report.zones, None, None, None)
    assert share_of(paths[-1], CHOSEN) > share_of(without[-1], CHOSEN)


@pytest.mark.parametrize("shape", [(1, 1), (3, 200), (300, 2)])
def test_maps_of_any_shape_and_without_data_are_drawn(
    found: CloudSurvey, tmp_path: Path, shape: tuple[int, int]
) -> None:
    blank = np.full(shape, np.nan, np.float32)
    state = np.full(shape, UNKNOWN, np.uint8)
    box = Box(0, shape[0], 0, shape[1])
    maps = TerrainMaps(found.maps.frame, found.maps.grid, box, dict.fromkeys(NAMED, blank), state)
    for path in figures.save_maps(tmp_path, maps):
        assert matplotlib.image.imread(path).shape[0] > 100


@pytest.mark.parametrize("most", [11, 30, 70])
def test_a_large_map_is_thinned_and_its_zones_stay_in_place(
    found: CloudSurvey, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, most: int
) -> None:
    monkeypatch.setattr("companion.desk.figures.picture.MOST_PIXELS", most)
    zones = tuple(moved(zone, 1, 2) for zone in found.report.zones)
    picture = Picture(found.maps, zones, found.parameters)
    assert max(picture.state.shape) <= most
    whole = np.zeros(found.maps.state.shape, bool)
    for zone in zones:
        row, col = zone.box.row0 - found.maps.box.row0, zone.box.col0 - found.maps.box.col0
        whole[row : row + zone.cells.shape[0], col : col + zone.cells.shape[1]] |= zone.cells == 1
    np.testing.assert_array_equal(picture.all_zones(), whole[:: picture.step, :: picture.step])


def test_a_zone_that_lies_outside_of_the_picture_is_not_drawn(found: CloudSurvey, tmp_path: Path) -> None:
    (zone,) = found.report.zones
    far = replace(zone, box=Box(10_000, 10_000 + zone.cells.shape[0], 0, zone.cells.shape[1]))
    cells, _ = Picture(found.maps, (far,), found.parameters).zone_cells(far)
    assert cells.size == 0
    inside, both = (Picture(found.maps, zones, found.parameters) for zones in ((zone,), (zone, far)))
    np.testing.assert_array_equal(both.all_zones(), inside.all_zones())
    assert both.all_zones().any()
