"""Most surprising flights, which are varied most, each family less often the more of it were flown."""

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
    """Most surprising flight of each family, by each part of the response, with a fault and without.

    A family are the flights that vary one another. What the sensor shows late by its nature stays surprising
    however often it is varied, and would take all flights; so its share sinks with its size.
    """

    def __init__(self, flown: Sequence[Scored]) -> None:
        numbers = np.array([_numbers(one.scenario) for one in flown])
        groups: dict[tuple[str, bool], list[int]] = {}
        for row, one in enumerate(flown):
            for part in one.surprises:
                groups.setdefault((part, is_default(one.scenario, "fault")), []).append(row)
        self._best: list[Scored] = []
        weights = []
        for part, is_plain in sorted(groups):
            ranked = sorted(groups[part, is_plain], key=lambda row: flown[row].surprises[part])
            for row, size in islice(_families(numbers, ranked), MOST):
                surprise = max(LEAST_SURPRISE, -flown[row].surprises[part])
                self._best.append(flown[row])
                weights.append(surprise**2 / (1.0 + size / PATIENCE))
        self._weights = np.array(weights)

    def drawn(self, rng: np.random.Generator) -> Scored | None:
        """Return one of them, by the square of its surprise and the size of its family; None without any."""
        if not self._best:
            return None
        return self._best[int(rng.choice(len(self._best), p=self._weights / self._weights.sum()))]


def _numbers(scenario: Scenario) -> list[float]:
    return [
        scenario.number(name)
        for name, part in SPACE.items()
        if not isinstance(part, Choice) and not part.whole
    ]


def _families(numbers: np.ndarray, ranked: Sequence[int]) -> Iterator[tuple[int, int]]:
    """Yield the first of each family in a sequence of rows, and how many flights the family has."""
    taken = np.zeros(len(numbers), bool)
    for row in ranked:
        if not taken[row]:
            family = (numbers == numbers[row]).sum(axis=1) >= RELATED
            taken |= family
            yield row, int(family.sum())
