"""Writer of all output files of a survey."""

from __future__ import annotations

import csv
import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from companion.desk.survey import geotiff
from companion.desk.survey.classified_points import write_classified
from companion.desk.survey.findings import Findings
from companion.desk.survey.flatgeobuf import fields_of, write_flatgeobuf
from companion.desk.survey.kml import write_kml
from companion.desk.survey.survey_page import write_page
from companion.desk.survey.zone_table import flat, write_geojson


def rasters(folder: Path, found: Findings) -> list[Path]:
    """Write all maps, or move those written already, and return their paths."""
    if found.drawings is not None:
        return [path.replace(folder / path.name) for path in found.drawings.rasters]
    wanted = geotiff.rasters(found.metric, found.parameters.mode)
    return [geotiff.write(folder / f"{each.name}.tif", each, found.maps, found.metric) for each in wanted]


def zones(
    folder: Path, files: Sequence[Path], found: Findings, described: Sequence[dict[str, Any]]
) -> list[Path]:
    """Write the zones in all formats, a table of them and the page, and return the paths."""
    geojson, kml, fgb, table = (folder / f"zones.{suffix}" for suffix in ("geojson", "kml", "fgb", "csv"))
    write_geojson(geojson, found.shapes, described, found.metric.reference.heights)
    rows = flat(described)
    write_kml(kml, found.shapes, rows)
    write_flatgeobuf(fgb, found.shapes, rows)
    write_csv(table, rows)
    page, survey = folder / "map.html", folder / "survey.json"
    write_page(page, found, rows)
    write_survey(survey, files, found)
    return [geojson, kml, fgb, table, page, survey]


def points(folder: Path, files: Sequence[Path], found: Findings) -> list[Path]:
    """Write the points with their classes, and return the paths."""
    return write_classified(folder, files, found.maps, found.metric)


def write_csv(path: Path, described: Sequence[dict[str, Any]]) -> None:
    """Write the zones, the best first; unknown values are empty."""
    with path.open("w", encoding="utf-8", newline="") as file:
        table = csv.DictWriter(file, fields_of(described), extrasaction="ignore")
        table.writeheader()
        table.writerows(described)


def write_survey(path: Path, files: Sequence[Path], found: Findings) -> None:
    """Write survey.json: the files, parameters, heights and counts that readers of the maps need."""
    reference = found.metric.reference
    document = {
        "files": [str(path) for path in files],
        "skipped": list(found.skipped),
        "crs": reference.crs.to_wkt(),
        "vertical_unit_m": reference.vertical_m,
        "cells": {"cell_m": found.parameters.cell_m, **found.cells},
        "points": {"read": found.n_read, "used": found.n_used, "dropped": found.dropped},
        "density_per_m2": found.density_per_m2,
        "parameters": found.parameters.model_dump(),
    }
    path.write_text(json.dumps(document, indent=1), "utf-8")
