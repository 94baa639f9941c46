"""Flights of the most surprising families, each drawn less often the more of it were flown."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import islice

import numpy as np

from tests.search.scenario import SPACE, Choice, Scenario, is_default
from tests.search.scored import Scored

MOST = 4  # families by each part of the response, with a fault and without
LEAST_SURPRISE = 1.0  # for a weight
RELATED = 4  # equal numbers: drawn apart, flights have none
PATIENCE = 40.0  # flights of a family after which it comes half as often


class Surprising:
    """Two flights each of the most surprising families, by part of the response, with a fault and without.

    A family are the flights that vary one another. What the sensor shows late by its nature stays surprising
    however often it is varied, and would take all flights; so its share sinks with its size. One of the two
    flights is the most surprising. The other has the least margin of those at least half as surprising: how
    late an answer is says little of how near the vehicle came.
    """

    def __init__(self, flown: Sequence[Scored]) -> None:
        numbers = np.array([_numbers(one.scenario) for one in flown])
        groups: dict[tuple[str, bool], list[int]] = {}
        for row, one in enumerate(flown):
            for part in one.surprises:
                groups.setdefault((part, is_default(one.scenario, "fault")), []).append(row)
        self._best: list[tuple[Scored, Scored]] = []
        weights = []
        for part, is_plain in sorted(groups):
            ranked = sorted(groups[part, is_plain], key=lambda row: flown[row].surprises[part])
            for row, family in islice(_families(numbers, ranked), MOST):
                most = flown[row].surprises[part]
                alike = [n for n in ranked if family[n] and flown[n].surprises[part] <= most / 2]
                nearest = min(alike, key=lambda n: flown[n].margin, default=row)
                self._best.append((flown[row], flown[nearest]))
                weights.append(max(LEAST_SURPRISE, -most) ** 2 / (1.0 + family.sum() / PATIENCE))
        self._weights = np.array(weights)

    def drawn(self, rng: np.random.Generator) -> tuple[Scored, Scored] | None:
        """Return those of one family, by the square of its surprise and by its size; None without any."""
        if not self._best:
            return None
        return self._best[int(rng.choice(len(self._best), p=self._weights / self._weights.sum()))]


def _numbers(scenario: Scenario) -> list[float]:
    return [
        scenario.number(name)
        for name, part in SPACE.items()
        if not isinstance(part, Choice) and not part.whole
    ]


def _families(numbers: np.ndarray, ranked: Sequence[int]) -> Iterator[tuple[int, np.ndarray]]:
    """Yield the first of each family in a sequence of rows, and for all flights whether they are of it."""
    taken = np.zeros(len(numbers), bool)
    for row in ranked:
        if not taken[row]:
            family = (numbers == numbers[row]).sum(axis=1) >= RELATED
            taken |= family
            yield row, family
