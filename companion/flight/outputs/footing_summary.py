"""Summary of a zone's headings and helicopter areas for JSON."""

from __future__ import annotations

from typing import Any

from slz import LandingPoint


def footing_summary(best: LandingPoint) -> dict[str, Any]:
    """Return headings to land at, what excludes the others, and the areas by D; None where not judged."""
    return {
        "headings_deg": None if best.headings_deg is None else list(best.headings_deg),
        "blocked_by": best.blocked_by or None,
        "areas": None if best.areas is None else best.areas.text,
    }


def headings_text(best: LandingPoint) -> str:
    """Return the headings to land at in words: any, none, or degrees; empty where not judged."""
    if best.headings_deg is None:
        return ""
    if best.can_land_at_any_heading:
        return "any"
    return " ".join(map(str, best.headings_deg)) or "none"
