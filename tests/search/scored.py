"""Flight as the search sees it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from tests.search.scenario import Scenario


@dataclass(frozen=True, slots=True)
class Scored:
    """Flight as the search sees it; less is better of score, margin, response (1: at once) and surprises.

    surprises: by part of the response. missed: distance (m) and compass bearing from the ordered point to the
    touchdown; None without one.
    """

    score: float
    margin: float
    response: float
    surprises: Mapping[str, float]
    behaviour: str
    scenario: Scenario
    missed: tuple[float, float] | None = None

    @property
    def surprise(self) -> float:
        """The least of the surprises; 0 without one."""
        return min(self.surprises.values(), default=0.0)
