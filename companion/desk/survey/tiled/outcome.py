"""Conversion of a tiled survey's result to the findings that all outputs use."""

from __future__ import annotations

import numpy as np

from companion.desk.survey.findings import Findings
from companion.desk.survey.geographic_polygon import wgs84
from companion.desk.survey.tiled.tile_store import Store
from companion.desk.survey.tiled.tiled_survey import Surveyed
from slz import TerrainMaps
from slz.terrain.layers import Output, reaching


def of_tiles(surveyed: Surveyed) -> Findings:
    """Return the findings: zones, and maps read from their tiles."""
    found = surveyed.found
    rows, cols = surveyed.layout.whole.shape
    return Findings(
        metric=surveyed.metric,
        parameters=surveyed.parameters,
        maps=Store(surveyed.layout),
        drawings=surveyed.drawings,
        zones=[one.zone for one in found],
        shapes=[wgs84(one.polygon_m, surveyed.metric) for one in found],
        outlines_m=[one.polygon_m for one in found],
        square_centres_m=[one.square_centre_m for one in found],
        ways=[one.ways for one in found],
        n_obstacles=[one.n_obstacles for one in found],
        cells={
            "rows": rows,
            "cols": cols,
            "safe": surveyed.n_safe,
            "unsafe": surveyed.n_unsafe,
            "unknown": rows * cols - surveyed.n_safe - surveyed.n_unsafe,
        },
        n_read=surveyed.n_read,
        n_used=surveyed.n_used,
        dropped=surveyed.dropped,
        density_per_m2=surveyed.density_per_m2,
        coordinate_spacing=surveyed.coordinate_spacing,
        skipped=[one.document() for one in surveyed.skipped],
        n_cut=sum(one.cut for one in found),
        stage_ms=surveyed.stage_ms,
    )


def whole_maps(findings: Findings) -> TerrainMaps:
    """Return all maps in memory, for pictures; layers that surveys do not keep are NaN."""
    maps, grid = findings.maps, findings.maps.grid
    box = grid.everything
    nothing = np.full(box.shape, np.nan, np.float32)
    layers = {
        layer.name: maps.read(layer.name, box) if Output.SURVEY in layer.outputs else nothing
        for layer in reaching(Output.MAPS)
    }
    return TerrainMaps(
        frame=findings.metric.frame,
        grid=grid,
        box=box,
        layers=layers,
        state=maps.read("state", box),
    )
