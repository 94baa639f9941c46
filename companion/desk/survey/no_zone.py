"""Reason for a survey without zones."""

from __future__ import annotations

import numpy as np

from companion.desk.survey.findings import Findings
from companion.desk.survey.overview import step_of, subsampled, water_mask
from slz import UNSAFE

MATTERING = 0.01  # share of the points read


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
    """Return how much ground may be water, None for none; in large surveys from a sample of cells."""
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
    """Return how many points were left out and as what, where they are a part of the points to matter."""
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
    """Return how much of the unsafe ground is too steep; in large surveys from a sample of cells."""
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
