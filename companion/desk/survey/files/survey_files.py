"""Writer of all output files of a survey."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from companion.desk.survey.files import geotiff
from companion.desk.survey.files.classified_points import write_classified
from companion.desk.survey.files.flatgeobuf import write_flatgeobuf
from companion.desk.survey.files.kml import write_kml
from companion.desk.survey.files.survey_page import write_page
from companion.desk.survey.files.zone_csv import write_csv, write_survey
from companion.desk.survey.findings import Findings
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
    geojson, kml, fgb, csv = (folder / f"zones.{suffix}" for suffix in ("geojson", "kml", "fgb", "csv"))
    write_geojson(geojson, found.shapes, described, found.metric.reference.heights)
    rows = flat(described)
    write_kml(kml, found.shapes, rows)
    write_flatgeobuf(fgb, found.shapes, rows)
    write_csv(csv, rows)
    page, survey = folder / "map.html", folder / "survey.json"
    write_page(page, found, rows)
    write_survey(survey, files, found)
    return [geojson, kml, fgb, csv, page, survey]


def points(folder: Path, files: Sequence[Path], found: Findings) -> list[Path]:
    """Write the points with their classes, and return the paths."""
    return write_classified(folder, files, found.maps, found.metric)
