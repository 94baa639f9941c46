"""Rule of freshness of the page: a value whose source is silent is not shown as present.

The page draws the document of the state and that of the zones. The former holds no value of a silent source,
but the age of its last word; the browser greys the latter by that. Verdicts on ground end with the map, and
with the position at which it is placed.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

AUTOPILOT, POSITION, MAP, VERDICT = "autopilot", "position", "map", "verdict"
NEVER: Mapping[str, float | None] = dict.fromkeys((AUTOPILOT, POSITION, MAP, VERDICT))
# Fields of the state that are told by a source, or computed from what it tells. The others are the
# companion's own, which are as old as the document.
FIELDS: Mapping[str, tuple[str, ...]] = {
    AUTOPILOT: (
        *("mode", "guided", "armed", "on_ground", "failsafe", "estimate_lost", "gps"),
        *("battery_pct", "battery_v", "battery_low", "height_home_m", "wind"),
    ),
    POSITION: (
        *("east_m", "north_m", "up_m", "velocity_enu_ms", "roll_deg", "pitch_deg", "yaw_deg", "height_m"),
        *("emergency", "here"),
    ),
    MAP: ("height_m", "blocked", "moving", "wires"),
    VERDICT: ("emergency", "way_in", "way_out", "here"),
}


def with_ages(
    document: dict[str, Any], now_ns: int, sources: Mapping[str, tuple[bool, int | None]]
) -> dict[str, Any]:
    """Return a state without the values of silent sources, and with the sources' ages as `past`.

    Parameters
    ----------
    sources
        Whether a source speaks, and when it last did (ns), None for never.

    Returns
    -------
    dict
        `past`: age of each silent source (s), None where it never spoke.
    """
    past = {
        name: None if at_ns is None else round(max(0, now_ns - at_ns) * 1e-9, 1)
        for name, (speaks, at_ns) in sources.items()
        if not speaks
    }
    gone = dict.fromkeys(field for name in past for field in FIELDS[name])
    return document | gone | {"past": past}
