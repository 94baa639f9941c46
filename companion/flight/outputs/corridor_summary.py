"""Summary of the ways in and out of a point for JSON."""

from __future__ import annotations

from typing import Any

from slz import SAFE, UNKNOWN, UNSAFE, Corridors

WORDS = {int(SAFE): "clear", int(UNSAFE): "blocked", int(UNKNOWN): "unknown"}


def corridor_summary(corridors: Corridors | None) -> dict[str, Any]:
    """Return the state of the best way, that straight down, and the clear bearings; None unjudged."""
    if corridors is None:
        return {"corridors": None}
    return {
        "corridors": {
            "state": WORDS[corridors.state],
            "overhead": WORDS[corridors.overhead],
            "bearings_deg": list(corridors.bearings_deg),
        }
    }
