"""Survey tables: zones.csv, one row a zone, and survey.json with files, parameters and counts."""

from __future__ import annotations

import csv
import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from companion.desk.survey.files.flatgeobuf import fields_of
from companion.desk.survey.findings import Findings


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
