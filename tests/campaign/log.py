"""Log file of the campaign: a line of JSON for each flight, in the order of their ends."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

Flown = dict[str, Any]


def read(path: Path) -> dict[int, Flown]:
    """Return the flights by number; a last line cut short by a stop is left out, and flown again."""
    flights: dict[int, Flown] = {}
    if not path.exists():
        return flights
    for line in path.read_text("utf-8").splitlines():
        try:
            flight = json.loads(line)
        except json.JSONDecodeError:
            continue
        flights[flight["number"]] = flight
    return flights


def append(path: Path, flight: Flown) -> None:
    """Add a flight."""
    path.parent.mkdir(parents=True, exist_ok=True)
    cut = path.exists() and not path.read_bytes().endswith(b"\n")
    with path.open("a", encoding="utf-8") as out:
        out.write(("\n" if cut else "") + json.dumps(flight) + "\n")
