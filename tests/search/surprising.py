"""Most surprising flights, which are varied most."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from tests.search.scenario import SPACE, Scenario, is_default
from tests.search.scored import Scored

MOST = 4  # by each part of the response, with a fault and without
LEAST_SURPRISE = 1.0  # for a weight


class Surprising:
    """Most surprising flights by each part of the response, with a fault and without, no two alike."""

    def __init__(self, flown: Sequence[Scored]) -> None:
        groups: dict[tuple[str, bool], list[Scored]] = {}
        for one in flown:
            for part in one.surprises:
                groups.setdefault((part, is_default(one.scenario, "fault")), []).append(one)
        self._best, surprises = [], []
        for part, is_plain in sorted(groups):
            ranked = sorted(groups[part, is_plain], key=lambda one: one.surprises[part])
            found = _unlike(ranked, MOST)
            self._best += found
            surprises += [one.surprises[part] for one in found]
        self._weights = np.maximum(LEAST_SURPRISE, -np.array(surprises)) ** 2

    def drawn(self, rng: np.random.Generator) -> Scored | None:
        """Return one of them, which comes as often as the square of its surprise; None without any."""
        if not self._best:
            return None
        return self._best[int(rng.choice(len(self._best), p=self._weights / self._weights.sum()))]


def _unlike(ranked: Sequence[Scored], most: int) -> list[Scored]:
    """Return the first of a sequence, each with most numbers other than those of all before."""
    found: list[Scored] = []
    for one in ranked:
        if len(found) < most and not any(_alike(one.scenario, other.scenario) for other in found):
            found.append(one)
    return found


def _alike(one: Scenario, other: Scenario) -> bool:
    return sum(one.values[name] == other.values[name] for name in SPACE) > len(SPACE) / 2
