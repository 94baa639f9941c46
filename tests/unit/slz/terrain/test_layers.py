"""Table of the layers: agrees with the kernels, with the parameters and with itself."""

from __future__ import annotations

import math

import pytest

import params
from slz.kernels.footprint import classify
from slz.terrain.layers import LAYERS, NAMED, Layer, Output, reaching

every_layer = pytest.mark.parametrize("layer", LAYERS, ids=lambda layer: layer.name)
NEEDS = {
    Output.GEOTIFF: {Output.MAPS, Output.SURVEY},
    Output.PICTURE: {Output.MAPS, Output.SURVEY},
    Output.BUTTON: {Output.PAGE},
}


def test_the_table_has_the_kernels_order() -> None:
    indices = [value for name, value in vars(classify).items() if name.startswith("A_")]
    assert [layer.at for layer in LAYERS] == sorted(indices) == list(range(len(LAYERS)))
    assert LAYERS[-1].at == classify.A_CERTAINTY  # `leave_unknown` writes NaN to all before it
    assert [layer.name for layer in LAYERS if not math.isnan(layer.empty)] == ["certainty"]


def test_no_name_and_no_file_occurs_twice() -> None:
    files = [layer.file for layer in LAYERS if layer.file]
    assert len(NAMED) == len(LAYERS)
    assert len({*files, "safe"}) == len(files) + 1


def test_the_page_gets_the_height_first() -> None:
    assert [layer.is_height for layer in reaching(Output.PAGE)][:2] == [True, False]
    assert not any(layer.is_height for layer in reaching(Output.BUTTON))


@every_layer
def test_a_layer_has_what_its_outputs_need(layer: Layer) -> None:
    for output in layer.outputs:
        assert NEEDS.get(output, set()) <= layer.outputs
    if layer.outputs & {Output.GEOTIFF, Output.PICTURE}:
        assert layer.file
    if Output.PAGE in layer.outputs:
        assert layer.step > 0
    if Output.BUTTON in layer.outputs or (Output.PICTURE in layer.outputs and not layer.is_height):
        assert 0 < round(layer.full / layer.step) <= 254


@every_layer
def test_a_layer_s_limit_is_a_parameter(layer: Layer) -> None:
    assert not layer.limit or layer.limit in {row.name for row in params.rows()}
