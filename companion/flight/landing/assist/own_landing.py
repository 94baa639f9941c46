"""Memory of a landing of the autopilot's own: what was said, refused and moved, as long as its mode lasts."""

from __future__ import annotations

from dataclasses import dataclass, field

from companion.flight.landing.situation import Situation, Vector
from companion.flight.landing.sticks import Pulses, are_moved

SECOND = 1_000_000_000


@dataclass(slots=True)
class AssistTally:
    """Events so far, for the summary.

    led, moved: landings with a target, and targets that were moved. unled: why landings had none. off_m:
    distance from the target at each touchdown.
    """

    led: int = 0
    moved: int = 0
    unled: list[str] = field(default_factory=list)
    off_m: list[float] = field(default_factory=list)


@dataclass(slots=True)
class OwnLanding:
    """Landing, or mode that lands at its end.

    since_ns: when it began to land. is_led: it follows the target. told: texts that were said, each once.
    refused: places that proved unsafe. has_moved_sticks: the rest of it is the pilot's.
    """

    mode: str
    since_ns: int
    is_led: bool = False
    told: set[str] = field(default_factory=set)
    refused: list[Vector] = field(default_factory=list)
    has_moved_sticks: bool = False
    lasting: dict[str, int] = field(default_factory=dict)
    _rest_us: Pulses | None = None

    def is_new(self, text: str) -> bool:
        """Return whether a text was not said yet in this landing, and note that it is."""
        is_new = text not in self.told
        self.told.add(text)
        return is_new

    def lasts_ns(self, name: str, is_true: bool, now_ns: int) -> int:
        """Return how long something has been true, -1 while it is not."""
        if not is_true:
            self.lasting.pop(name, None)
            return -1
        return now_ns - self.lasting.setdefault(name, now_ns)

    def watch_sticks(self, s: Situation, before_us: Pulses | None) -> None:
        """Notice roll or pitch away from before the landing.

        In a failsafe they may be those of a receiver that hears nobody; the autopilot drops its target.
        """
        if self._rest_us is None:
            self._rest_us = before_us or s.sticks_us
        self.has_moved_sticks |= not s.failsafe and are_moved(s.sticks_us, self._rest_us)
