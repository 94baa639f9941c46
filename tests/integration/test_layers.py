"""Reach of the layers: each layer of the table is in every output that the table names for it."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
import rasterio

import params
from companion.desk import survey
from companion.desk.survey.tiled.tiled_survey import of_tiles, whole_maps
from companion.flight.dashboard.tile_pyramid import TilePyramids
from slz import Pipeline, TerrainMaps
from slz.terrain.layers import LAYERS, Layer, Output
from tests.e2e.chromium import Chromium
from tests.e2e.shown import Shown
from tests.unit.companion.desk.survey.clouds import write
from tests.unit.companion.desk.survey.tiled.ground import parameters, points, surveyed
from tests.unit.slz.hand_made import window

MODES = ("default", "source")


def reaches(output: Output) -> pytest.MarkDecorator:
    found = [layer for layer in LAYERS if output in layer.outputs]
    return pytest.mark.parametrize("layer", found, ids=lambda layer: layer.name)


def pipeline(mode: str = "default") -> Pipeline:
    """Return a pipeline that has seen ground of 16 m by 16 m with a step and a slope."""
    rng = np.random.default_rng(7)
    east, north = rng.uniform(-8, 8, (2, 60_000))
    up = np.where(east > 4, 0.5, 0.0) + np.maximum(0.0, -0.3 * north) + rng.normal(0, 0.01, len(east))
    made = Pipeline(params.build({"mode": mode, "zone_m": 60.0, "min_boundary_points": 4}), (0.0, 0.0))
    made.process(window(np.column_stack([east, north, up]), sensor=(0.0, 0.0, 20.0)))
    return made


@pytest.fixture(scope="module")
def maps() -> dict[str, TerrainMaps]:
    found = {mode: pipeline(mode).maps(which="near") for mode in MODES}
    return {mode: made for mode, made in found.items() if made is not None}


@pytest.fixture(scope="module")
def cloud(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write(tmp_path_factory.mktemp("cloud") / "a.laz", points(60_000))


@pytest.fixture(scope="module")
def out(cloud: Path) -> Path:
    """Return the folder of `slz map`."""
    folder = cloud.parent / "out"
    survey.run([cloud], folder, parameters(), lambda *_: None)
    return folder


@pytest.fixture(scope="module")
def tiled(cloud: Path) -> TerrainMaps:
    """Return the maps of the same survey by tiles."""
    return whole_maps(of_tiles(surveyed([cloud], cloud.parent / "work", tile_m=64.0)))


@reaches(Output.MAPS)
@pytest.mark.parametrize("mode", MODES)
def test_the_maps_hold_it_where_the_mode_knows_it(
    maps: dict[str, TerrainMaps], layer: Layer, mode: str
) -> None:
    values = maps[mode].layers[layer.name]
    assert values.shape == maps[mode].state.shape
    assert np.isfinite(values).any() == bool(layer.unit_in(mode))


@reaches(Output.SURVEY)
def test_a_survey_in_tiles_keeps_it(tiled: TerrainMaps, layer: Layer) -> None:
    if Output.MAPS in layer.outputs:
        assert np.isfinite(tiled.layers[layer.name]).mean() > 0.3


@reaches(Output.GEOTIFF)
def test_a_survey_has_its_geotiff(out: Path, layer: Layer) -> None:
    with rasterio.open(out / f"{layer.file}.tif") as file:
        values = file.read(1)
        assert (file.dtypes, file.units) == (("float32",), (layer.unit,))
        assert np.isnan(file.nodata)
    assert np.isfinite(values).mean() > 0.3


@reaches(Output.PICTURE)
def test_a_survey_has_its_picture(out: Path, layer: Layer) -> None:
    assert (out / f"{layer.file}.png").stat().st_size > 10_000


@reaches(Output.PAGE)
def test_the_page_knows_its_value_at_a_point(maps: dict[str, TerrainMaps], layer: Layer) -> None:
    made, pyramids = pipeline(), TilePyramids()
    drawn = made.drawn("near", 10_000)
    assert drawn is not None
    pyramids.apply_changes("near", drawn)
    near = maps["default"]
    for east, north in ((0.1, 3.1), (4.1, 2.1), (0.1, -3.1)):
        found = pyramids.cell(east, north)
        assert found is not None
        row, col = near.grid.index(east, north)
        value = float(near.layers[layer.name][row - near.box.row0, col - near.box.col0])
        expected = None if math.isnan(value) else pytest.approx(value, abs=layer.step / 2 + 1e-3)
        assert found[1].values[layer.name] == expected


def test_the_browser_offers_and_shows_all_that_it_is_told(chromium: Path) -> None:
    made = pipeline()
    with Shown() as shown, Chromium(chromium) as browser:
        browser.open(shown.url)
        browser.until("slz.model.state")
        drawn = made.drawn("near", 10_000)
        assert drawn is not None
        shown.board.map_changes.append(("near", drawn))
        browser.script("slz.bird.follow = false, slz.bird.centre = [0, 0], slz.bird.scale = 12")
        browser.until("[...slz.sheets.sheets.near.blocks.values()].some(block => block.data)")
        offered = browser.script("[...document.querySelectorAll('#layers button')].map(b => b.textContent)")
        assert offered == ["Ground", *(one.title for one in LAYERS if Output.BUTTON in one.outputs)]
        assert painted(browser, offered) == len(offered)
        browser.script("slz.bird.onPick(0.1, 3.1, null)")
        browser.until("Boolean(slz.model.picked?.facts && document.querySelector('#choice dd'))")
        pairs = browser.script("[...document.querySelectorAll('#choice dl div')].map(p => p.innerText)")
        values = dict(pair.split("\n") for pair in pairs)
        assert {one.title for one in LAYERS if Output.PAGE in one.outputs} <= set(values)
        assert "–" not in values.values()
        assert browser.errors == []


def painted(browser: Chromium, offered: list[str]) -> int:
    """Return how many pictures of one block the buttons give that differ."""
    found = set()
    for k in range(len(offered)):
        browser.script(f"document.querySelectorAll('#layers button')[{k}].click()")
        found.add(
            browser.script(
                "(b => slz.sheets.picture(b).toDataURL())"
                "([...slz.sheets.sheets.near.blocks.values()].find(block => block.data))"
            )
        )
    return len(found)
