"""Summary of a surface for JSON."""

from __future__ import annotations

import math
from typing import Any

from slz import SurfaceHere, SurfaceKind


def surface_summary(surface: SurfaceHere) -> dict[str, Any]:
    """Return a surface in words, its probability, that of water, and a roof's height; None where unknown."""
    unknown = surface.kind is SurfaceKind.UNKNOWN
    return {
        "surface": None if unknown else surface.kind.word,
        "surface_probability": None if unknown else _number(surface.probability, 3),
        "water": None if unknown and surface.water == 0 else _number(surface.water, 3),
        "raised_m": _number(surface.raised_m, 1) if surface.kind is SurfaceKind.ROOF else None,
    }


def _number(value: float, digits: int) -> float | None:
    return round(float(value), digits) if math.isfinite(value) else None
