"""Flight on the bench towards a landing target, step by step, and what is seen of it."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable
from typing import Any, Self

from tests.unit.sitl.bench_flight import Bench

Place = tuple[float, float]


class TargetedFlight(ABC):
    """Vehicle on a bench, and a target (east, north) that is streamed while it is set."""

    def __init__(self, bench: Bench) -> None:
        self.bench = bench
        self.target: Place | None = None
        self.heights: list[float] = []

    def run(self, seconds: float) -> Self:
        self.bench.run(seconds, self.tell)
        return self

    def until(self, reached: Callable[[], bool], most_s: float = 90.0) -> Self:
        end_ns = self.bench.now_ns + most_s * 1e9
        while not reached() and self.bench.now_ns < end_ns:
            self.run(0.05)
        assert reached(), (self.mode, self.height_m)
        return self

    def below(self, height_m: float) -> Self:
        return self.until(lambda: self.height_m < height_m)

    def land(self) -> Self:
        return self.until(lambda: self.bench.vehicle.contact is not None)

    @abstractmethod
    def tell(self) -> None:
        """Send the autopilot the messages of every step, and note what is seen."""

    @property
    def height_m(self) -> float:
        return float(self.bench.truth.pos_enu_m[2])

    @property
    def mode(self) -> str:
        return self.bench.autopilot.mode_name

    def away_m(self, place: Place) -> float:
        return math.dist(self.bench.truth.pos_enu_m[:2], place)

    def off_m(self, place: Place | None = None) -> float:
        """Return the distance of the touchdown from a place, the target by default."""
        contact, place = self.bench.vehicle.contact, place or self.target
        assert contact is not None
        assert place is not None
        return math.dist((contact["e"], contact["n"]), place)

    def sent(self, name: str) -> list[Any]:
        return [m for m in self.bench.sent if m.get_type() == name]

    def texts(self) -> list[str]:
        return [m.text for m in self.sent("STATUSTEXT")]

    def landed_states(self) -> list[int]:
        """Return the landed states in the order in which they were reported, repetitions left out."""
        states = [int(m.landed_state) for m in self.sent("EXTENDED_SYS_STATE")]
        return [state for at, state in enumerate(states) if at == 0 or state != states[at - 1]]
