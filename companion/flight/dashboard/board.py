"""What the companion leaves for the page to read, and what the page asks for.

Two threads share it without a lock: every value is replaced as a whole or only appended to, and whoever reads
takes what is there now. So nobody ever waits for a browser.
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
# Tiles of a window, copied in the pipeline's thread: two milliseconds.
NEAR_TILES: tuple[Literal["near", "far"], int] = ("near", 160)
FAR_TILES: tuple[Literal["near", "far"], int] = ("far", 40)


@dataclass(frozen=True, slots=True)
class Text:
    """What the pilot was told: a number that rises, time of day, severity of MAVLink, words."""

    number: int
    wall_s: float
    severity: int
    text: str


class Board:
    """Newest state of everything on show.

    Attributes
    ----------
    state, health
        Documents of `state_document`: ten times and once a second; None before the first.
    report, report_number, latency_ms
        Newest report, how many there were, and how long the last one took from its last scan.
    texts
        What the pilot was told, the newest last.
    path
        Flown path, east, north, up (m); cut to half when it is long, `path_number` counting the cuts.
    drawn
        Changes of the maps, by map, that the page has not taken yet.
    parameters
        In force.
    viewers
        Browsers that look; nothing is prepared while there are none.
    computing
        Tells whether a window is being computed: Python's lock is the landing's then.
    run
        Name of this run of the companion; a page that was open before forgets what it knew of another one.
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
        self.drawn: deque[tuple[str, Drawn]] = deque()
        self.viewers = 0
        self.computing: Callable[[], bool] = lambda: False
        self.run = secrets.token_hex(8)
        self._numbers = itertools.count(1)

    def look(self, pipeline: Pipeline, *, anew: bool) -> bool:
        """Take what changed of the maps, in the pipeline's thread; tell whether it was time to.

        anew: take all of them.
        """
        if self.viewers <= 0 or len(self.drawn) >= MOST_BATCHES:
            return False
        for name, most in (NEAR_TILES, FAR_TILES):
            drawn = pipeline.drawn(name, most, anew=anew)
            if drawn is not None and (drawn.tiles or drawn.gone):
                self.drawn.append((name, drawn))
        return True

    def take(self, report: Report, latency_ms: float) -> None:
        """Show a report."""
        self.report, self.latency_ms = report, latency_ms
        self.report_number += 1

    def say(self, text: str, severity: int) -> None:
        """Show a text."""
        self.texts.append(Text(next(self._numbers), time.time(), severity, text))

    def leave_path(self) -> None:
        """Forget the path: it is of another map frame."""
        self.path = []
        self.path_number += 1

    def fly(self, enu_m: tuple[float, float, float]) -> None:
        """Lengthen the path, unless it ends there."""
        if self.path and self.path[-1] == enu_m:
            return
        if len(self.path) >= MOST_PATH:
            self.path = self.path[::2]
            self.path_number += 1
        self.path.append(enu_m)
