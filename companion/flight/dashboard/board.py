"""Shared state between the companion, which writes it, and the page, which reads it.

Two threads share it without a lock: every value is replaced as a whole or only appended to, and a reader uses
the present value. So the companion never waits for a browser.
"""

from __future__ import annotations

import itertools
import secrets
import time
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Literal

from params import Parameters
from slz import Drawn, Pipeline, Report

MOST_TEXTS = 200
MOST_PATH = 20_000
MOST_BATCHES = 4
# Greatest number of tiles per window, copied in the pipeline's thread: two milliseconds.
NEAR_TILES: tuple[Literal["near", "far"], int] = ("near", 160)
FAR_TILES: tuple[Literal["near", "far"], int] = ("far", 40)


@dataclass(frozen=True, slots=True)
class Text:
    """Text for the pilot: increasing number, time of day, MAVLink severity, text."""

    number: int
    wall_s: float
    severity: int
    text: str


class Board:
    """Newest state of everything that the page shows.

    Attributes
    ----------
    state, health
        Documents of `state_document`, ten times and once a second; None before the first.
    report, report_number, latency_ms
        Newest report, count of reports, and median age of the last one's returns at that time.
    texts
        Texts for the pilot, newest last.
    path
        Flown path, east, north, up (m); halved when it is long, `path_number` counts the new paths.
    map_changes
        Changes of the maps, by map, that the page has not processed yet.
    parameters
        Parameters in force.
    viewers
        Number of connected browsers; nothing is prepared without one.
    computing
        Returns whether a window is being computed: the landing then needs Python's lock.
    run
        ID of this run of the companion; a page that stayed open drops the data of another run.
    """

    def __init__(self, parameters: Parameters) -> None:
        self.parameters = parameters
        self.state: dict[str, Any] | None = None
        self.health: dict[str, Any] | None = None
        self.replay: dict[str, Any] | None = None
        self.report: Report | None = None
        self.report_number = 0
        self.latency_ms = float("nan")
        self.texts: deque[Text] = deque(maxlen=MOST_TEXTS)
        self.path: list[tuple[float, float, float]] = []
        self.path_number = 0
        self.map_changes: deque[tuple[str, Drawn]] = deque()
        self.viewers = 0
        self.computing: Callable[[], bool] = lambda: False
        self.run = secrets.token_hex(8)
        self._numbers = itertools.count(1)

    def copy_map_changes(self, pipeline: Pipeline, *, anew: bool) -> bool:
        """Copy the changes of the maps, in the pipeline's thread; return whether it was time to.

        anew: copy the maps as a whole.
        """
        if self.viewers <= 0 or len(self.map_changes) >= MOST_BATCHES:
            return False
        for name, most in (NEAR_TILES, FAR_TILES):
            drawn = pipeline.drawn(name, most, anew=anew)
            if drawn is not None and (drawn.tiles or drawn.gone):
                self.map_changes.append((name, drawn))
        return True

    def set_report(self, report: Report, latency_ms: float) -> None:
        """Store a new report."""
        self.report, self.latency_ms = report, latency_ms
        self.report_number += 1

    def add_text(self, text: str, severity: int) -> None:
        """Add a text for the pilot."""
        self.texts.append(Text(next(self._numbers), time.time(), severity, text))

    def clear_path(self) -> None:
        """Clear the path, which is in another map frame."""
        self.path = []
        self.path_number += 1

    def add_position(self, enu_m: tuple[float, float, float]) -> None:
        """Append to the path, unless it already ends there."""
        if self.path and self.path[-1] == enu_m:
            return
        if len(self.path) >= MOST_PATH:
            self.path = self.path[::2]
            self.path_number += 1
        self.path.append(enu_m)
