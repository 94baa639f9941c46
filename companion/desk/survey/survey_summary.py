"""JSON summary of a survey."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from companion.desk.clouds.unit_statements import unit_name
from companion.desk.survey.cloud_quality import COARSE
from companion.desk.survey.findings import Findings
from companion.desk.survey.overview import step_of, subsampled, water_mask
from params import Parameters
from slz import UNSAFE

WGS84_ERROR_M = 2.0  # greater errors get a warning, since vehicles land by latitude and longitude

MATTERING = 0.01  # share of the points read


def summary(
    files: Sequence[Path], found: Findings, described: list[dict[str, Any]], outputs: list[Path]
) -> dict[str, Any]:
    """Return the JSON object of a survey, without its duration and without NaN."""
    reference = found.metric.reference
    return {
        "files": [str(path) for path in files],
        "skipped": list(found.skipped),
        "crs": reference.name,
        "epsg": reference.epsg,
        "unit_m": reference.unit_m,
        "vertical_unit_m": reference.vertical_m,
        "vertical_unit_from": reference.vertical_from,
        "vertical_datum": reference.heights,
        "wgs84_error_m": found.metric.wgs84_error_m,
        "points": {
            "read": found.n_read,
            "used": found.n_used,
            "dropped": {name: count for name, count in found.dropped.items() if count},
            "per_m2": round(found.density_per_m2, 3),
        },
        "cells": {"cell_m": found.parameters.cell_m, **found.cells},
        "coverage_m": found.parameters.coverage_m,
        "zones": described,
        "no_zone": reason(found),
        "outputs": [str(path) for path in outputs],
        "warnings": [*_warnings(found), *_coarse(found)],
        "stage_ms": {name: round(ms, 1) for name, ms in found.stage_ms.items()},
    }


def _coarse(found: Findings) -> list[str]:
    """Return a warning if the spacing of 32-bit coordinates exceeds a quarter of a cell."""
    step_m = found.coordinate_spacing * max(found.metric.x_m, found.metric.y_m)
    if step_m <= COARSE * found.parameters.cell_m:
        return []
    return [f"32-bit coordinates of this size are {step_m:g} m apart: store them as 64-bit numbers"]


def _warnings(found: Findings) -> list[str]:
    """Return the warnings that the user needs in order to judge the zones."""
    own, warnings = found.parameters, []
    default = Parameters.model_fields["coverage_m"].default
    if own.coverage_m > default:
        warnings.append(
            f"{found.density_per_m2:.1f} points/m2: gaps of up to {own.coverage_m:g} m count as seen,"
            " so a narrower hazard may have no return"
        )
    if not found.cells["safe"] + found.cells["unsafe"]:
        warnings.append(
            f"{found.density_per_m2:.1f} points/m2 cover no ground without gaps of {own.coverage_m:g} m:"
            " try a larger --cell-m or --set coverage_m"
        )
    if found.dropped.get("stray"):
        warnings.append(f"{found.dropped['stray']} points lie far from all others and were dropped")
    water = maybe_water(found)
    if water is not None:
        warnings.append(water)
    if found.n_cut:
        warnings.append(
            f"{found.n_cut} zones are parts of larger ones, cut along lines of a fixed lattice: they adjoin"
        )
    reference, error_m = found.metric.reference, found.metric.wgs84_error_m
    if reference.vertical_from == "horizontal unit" and reference.vertical_m != 1.0:
        unit = unit_name(reference.vertical_m)
        warnings.append(f"{reference.name} has no heights: z is taken in {unit} like x and y")
    if error_m is None or error_m > WGS84_ERROR_M:
        known = "an unknown error" if error_m is None else f"an error of up to {error_m:g} m"
        warnings.append(f"latitudes and longitudes have {known}: PROJ knows no better way to WGS-84")
    return warnings


def reason(found: Findings) -> str | None:
    """Return in one sentence why there is no zone; None where there is one.

    Either nothing is known (too few points for gaps of `coverage_m`), or nothing known is safe (too steep,
    too rough or too near an obstacle), or no safe ground holds a square of `min_square_m`. Behind it: what
    was dropped of the points, and what may be water.
    """
    if found.zones:
        return None
    return "; ".join(filter(None, (_why(found), _dropped(found), maybe_water(found))))


def maybe_water(found: Findings) -> str | None:
    """Return the sentence on possible water, None without any; in large surveys from a sample of cells."""
    p, step = found.parameters, step_of(found.maps.grid)
    n = int(np.count_nonzero(water_mask(found.maps, p)))
    if not n:
        return None
    area_m2 = n * (step * p.cell_m) ** 2
    return (
        f"{area_m2:.0f} m2 may be water (level, with banks: probability above {p.water_suspicion:.0%}) and"
        " count as unseen; where you know better, --set water_suspicion=1"
    )


def _dropped(found: Findings) -> str:
    """Return the numbers of points left out, by reason, of reasons with a share of `MATTERING` or more."""
    counts = {name: n for name, n in found.dropped.items() if n >= MATTERING * found.n_read}
    return ", ".join(f"{n:,} points dropped as {name.replace('_', ' ')}" for name, n in counts.items())


def _why(found: Findings) -> str:
    p, cells = found.parameters, found.cells
    cell_m2 = p.cell_m**2
    known = cells["safe"] + cells["unsafe"]
    if not known:
        return (
            f"{found.n_used} of {found.n_read} points, {found.density_per_m2:.2f} per m2, leave no ground"
            f" without gaps of {p.coverage_m:g} m: give more points, a larger --cell-m or --set coverage_m"
        )
    if not cells["safe"]:
        return f"none of the {known * cell_m2:.0f} m2 of known ground is safe: {_unsafe(found)}"
    return (
        f"no square of {p.min_square_m:g} m fits into the {cells['safe'] * cell_m2:.0f} m2 of safe ground, of"
        f" {known * cell_m2:.0f} m2 known: a smaller --min-square-m would ask for less; {_unsafe(found)}"
    )


def _unsafe(found: Findings) -> str:
    """Return the share of unsafe ground that is too steep; in large surveys from a sample of cells."""
    limit, step = found.parameters.safe_slope_deg, step_of(found.maps.grid)
    unsafe = subsampled(found.maps, "state", step) == UNSAFE
    n = int(np.count_nonzero(unsafe))
    if not n:
        return "nothing known is unsafe"
    slope = np.asarray(subsampled(found.maps, "slope_deg", step), np.float64)[unsafe]
    steep = np.count_nonzero(slope > limit) / n
    return (
        f"{steep:.0%} of what is unsafe is steeper than {limit:g} degrees, {1 - steep:.0%} too rough or too"
        " near an obstacle"
    )
