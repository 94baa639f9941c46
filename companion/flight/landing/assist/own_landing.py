"""Memory of a landing of the autopilot's own, as long as its mode lasts, and the reason why it is not led."""

from __future__ import annotations

from dataclasses import dataclass, field

from companion.flight.landing.assist.landing_here import Here, LandingHere
from companion.flight.landing.situation import MissingInput, Severity, Situation, Vector

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


def lost_of(s: Situation) -> str:
    """Return the input that is lost without which a target would lead anywhere, "" without a loss."""
    if s.estimate_lost:
        return f"{s.estimate_lost} lost"
    if s.position_enu_m is None or s.velocity_enu_ms is None:
        return MissingInput.POSITION_LOST.text
    return "GPS lost" if s.gps_lost and s.tracked is not True else ""


def why_not_led(s: Situation, now: LandingHere) -> tuple[Severity, str]:
    """Return severity and reason why a landing has no target: a loss, no map, no place, or a deaf mode."""
    missing = lost_of(s) or ("" if s.lidar_ok else s.no_map_reason.text)
    if missing:
        return Severity.CRITICAL, f"{missing}, not led"
    if now.here is Here.SAFE:
        return Severity.NOTICE, "safe below, takes no target"
    if now.here is Here.NEAR:
        return Severity.CRITICAL, f"safe is {now.way}, takes no target"
    return Severity.CRITICAL, f"nothing safe, nearest {now.way}" if now.way else "nothing safe in reach"
