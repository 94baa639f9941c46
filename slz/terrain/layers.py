"""Layers of the map: the table from which maps, survey files, pictures and the pilot's page are made."""

from __future__ import annotations

import enum
import math
from dataclasses import dataclass
from typing import Literal

from slz.kernels.footprint.classify import (
    A_CERTAINTY,
    A_HEIGHT,
    A_RELIEF,
    A_ROUGHNESS,
    A_SIGMA,
    A_SLOPE,
    A_TOP,
)


class Output(enum.Enum):
    """Place that a layer reaches."""

    MAPS = "copies of the maps, `TerrainMaps`"
    SURVEY = "tiles of a survey larger than memory"
    GEOTIFF = "GeoTIFF of a survey"
    PICTURE = "picture of a survey, a flight or a replay"
    PAGE = "pilot's page: value of a tapped point"
    BUTTON = "pilot's page: button and colours"


EVERYWHERE = frozenset(Output)


@dataclass(frozen=True, slots=True)
class Layer:
    """One value of every cell.

    name: quantity_unit. at: index in the maps of `slz.kernels.footprint.derive_maps`. title: heading.
    meaning: description, with `{unit}` in the place of the unit. unit: "m", "degree" or "probability".
    source_unit: unit in source mode, empty where the sources have no such layer. worst: what stands for
    several cells. outputs: what it reaches. file: name of its GeoTIFF and picture. limit: parameter above
    which a value is unsafe, empty for none. step: of the values on the page. full: value of a ramp's last
    colour. digits: after the decimal point, in percent for a probability. empty: value where unknown.
    is_height: over the datum of the map.
    """

    name: str
    at: int
    title: str
    meaning: str
    unit: Literal["m", "degree", "probability"]
    source_unit: Literal["", "m", "degree", "probability"] = ""
    worst: Literal["highest", "lowest", "mean"] = "highest"
    outputs: frozenset[Output] = EVERYWHERE
    file: str = ""
    limit: str = ""
    step: float = math.nan
    full: float = math.nan
    digits: int = 2
    empty: float = math.nan
    is_height: bool = False

    def unit_in(self, mode: str) -> str:
        """Return the unit in a mode, empty where the layer is unknown in it."""
        return self.source_unit if mode == "source" else self.unit


# In the order of the kernels; the certainty is the last.
LAYERS = (
    Layer(
        "height_m", A_HEIGHT, "Height", "mean height of the returns, {unit}", "m", "m", "mean",
        EVERYWHERE - {Output.BUTTON}, file="dsm", step=0.005, is_height=True,
    ),
    Layer(
        "top_m", A_TOP, "Top", "highest return, {unit}", "m", outputs=frozenset({Output.SURVEY}),
        is_height=True,
    ),
    Layer(
        "slope_deg", A_SLOPE, "Slope", "slope, degrees", "degree", "degree", file="slope",
        limit="safe_slope_deg", step=0.25, full=20.0, digits=1,
    ),
    Layer(
        "slope_sigma_deg", A_SIGMA, "Error of slope", "standard error of the slope, degrees", "degree",
        outputs=frozenset({Output.MAPS}),
    ),
    Layer(
        "relief_m", A_RELIEF, "Relief", "relief about the plane of the footprint, {unit}", "m",
        outputs=frozenset({Output.MAPS, Output.PAGE}), limit="relief_m", step=0.01,
    ),
    Layer(
        "roughness", A_ROUGHNESS, "Roughness", "roughness, {unit}", "m", "degree",
        outputs=frozenset({Output.MAPS, Output.SURVEY, Output.GEOTIFF}), file="roughness",
    ),
    Layer(
        "certainty", A_CERTAINTY, "Certainty", "probability that the footprint is safe", "probability",
        "probability", "lowest", EVERYWHERE - {Output.GEOTIFF, Output.PICTURE},
        step=0.005, full=1.0, digits=1, empty=0.0,
    ),
)  # fmt: skip
NAMED = {layer.name: layer for layer in LAYERS}


def reaching(output: Output) -> tuple[Layer, ...]:
    """Return the layers that reach an output, in their order."""
    return tuple(layer for layer in LAYERS if output in layer.outputs)
