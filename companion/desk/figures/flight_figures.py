"""Pictures of a finished flight's maps, as PNG."""

from __future__ import annotations

from pathlib import Path

from companion.desk.figures import save_flight
from companion.flight.app import Companion
from companion.flight.landing.situation import Phase


def draw_flight(companion: Companion, out: Path) -> dict[str, str]:
    """Draw a flight's maps into a folder; return the files by name."""
    maps = companion.maps
    if maps is None:
        return {}
    zones = companion.mapping.latest.newest.zones if companion.mapping.latest.newest else ()
    chosen = companion.executive.tally.chosen_enu_m
    path = companion.deciding.path.enu_m.array()
    landed = companion.executive.phase is Phase.LANDED
    touchdown = path[-1] if landed and len(path) else None
    files = save_flight(out, maps, zones, path, chosen, touchdown, companion.parameters)
    return {file.stem: str(file) for file in files}
