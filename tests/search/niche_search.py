"""Search by niches: keep the best scenarios of each, and change them (MAP-Elites, Mouret and Clune 2015).

The best of all flights are soon alike: the search would end at what is always close, such as a tall hazard
while the LiDAR fails, and never see what is late where it need not be. Niches are by behaviour, which is the
end and what was answered, with a fault and without, with a hazard and without, and by fault. The best are
those of the least score, those that answered latest, and those that answered later than expected
(`surprise.py`): what is answered late while nothing is near becomes unsafe by one more change. Niches that
lately became better are drawn from more often, and half of what is drawn has no fault. Six of ten flights
vary the most surprising by each part of the response in a few parameters, for among so many niches they would
come seldom, or first cross them with the flight of their family that came nearest. Where both a fault and a
hazard came, some of these leave one of them out, for one trouble may hide what the other does. A vehicle that
comes down beside the point is safe there unless something stands in this place: half of the variations put a
hazard there.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Hashable, Sequence
from dataclasses import replace

import numpy as np

from tests.search.scenario import (
    DEFAULTS,
    SPACE,
    Choice,
    Range,
    Scenario,
    acting,
    draw,
    is_angle,
    is_default,
    rounded,
    some_hazard,
    telling,
)
from tests.search.scored import Scored
from tests.search.surprising import Surprising

Niche = Callable[[str, Scenario], Hashable]
NICHES: tuple[Niche, ...] = (
    lambda behaviour, scenario: (behaviour, is_default(scenario, "fault"), is_default(scenario, "hazard")),
    lambda _, scenario: scenario.values["fault"],
)
FIRST = 40  # flights before anything is learnt
NEW_SHARE, SURPRISING_SHARE = 0.3, 0.6  # drawn anew; varies the most surprising
ELITE = 2  # of a niche, by score, response and surprise each
LATELY, MORE_OFTEN = 60, 20.0  # flights ago; weight of a niche that became better since
PLAIN_SHARE = 0.5  # of those drawn: without a fault, which makes answers late by itself
MISSED_M, TO_MEET_SHARE = 1.0, 0.5  # touchdowns so far from the point get a hazard there, so often
CROSSED_SHARE = 0.5  # of the variations of what surprises: of two flights of one family
ALONE_SHARE = 0.15  # of the variations of what surprises: fault and hazard not together
CHANGES, FEW_CHANGES = (1, 4), (2, 3)  # parameters that are drawn again; of what surprises
NEAR = (0.02, 0.2)  # of a range: changes that are none to somewhere else, as often small as large


def next_generation(rng: np.random.Generator, flown: Sequence[Scored], count: int) -> list[Scenario]:
    """Return the scenarios to fly next; none is like those before while too few are flown."""
    if len(flown) < FIRST:
        return [telling(rng) for _ in range(count)]
    kinds, surprising = [_Elites(flown, niche) for niche in NICHES], Surprising(flown)
    return [_one(rng, kinds[int(rng.integers(len(kinds)))], surprising) for _ in range(count)]


class _Elites:
    """Best scenarios of each niche of one kind."""

    def __init__(self, flown: Sequence[Scored], niche: Niche) -> None:
        niches: dict[Hashable, list[int]] = {}
        for number, one in enumerate(flown):
            niches.setdefault(niche(one.behaviour, one.scenario), []).append(number)
        best = [
            sorted(niches[key], key=rank)[:ELITE]
            for key in sorted(niches, key=str)
            for rank in (
                lambda n: (flown[n].score, n),
                lambda n: (flown[n].response, flown[n].score, n),
                lambda n: (flown[n].surprise, flown[n].score, n),
            )
        ]
        lately = [max(each) >= len(flown) - LATELY for each in best]
        weights = np.where(lately, MORE_OFTEN, 1.0)
        self._best = [[flown[number] for number in each] for each in best]
        plain = np.array([is_default(one[0].scenario, "fault") for one in self._best])
        for part, share in ((plain, PLAIN_SHARE), (~plain, 1.0 - PLAIN_SHARE)):
            weights[part] *= share / max(1.0, weights[part].sum())
        self._shares = weights / weights.sum()

    def drawn(self, rng: np.random.Generator) -> Scored:
        best = self._best[int(rng.choice(len(self._best), p=self._shares))]
        return best[int(rng.integers(len(best)))]


def _one(rng: np.random.Generator, elites: _Elites, surprising: Surprising) -> Scenario:
    kind = rng.random()
    if kind < NEW_SHARE:
        return telling(rng)
    if kind < NEW_SHARE + SURPRISING_SHARE and (best := surprising.drawn(rng)) is not None:
        return _alone(rng, _bred(rng, *best))
    return _varied(rng, elites.drawn(rng), CHANGES)


def _varied(rng: np.random.Generator, best: Scored, changes: tuple[int, int]) -> Scenario:
    if best.missed is not None and best.missed[0] > MISSED_M and rng.random() < TO_MEET_SHARE:
        return _met(rng, best.scenario, *best.missed)
    return _changed(rng, best.scenario, changes)


def _bred(rng: np.random.Generator, most: Scored, nearest: Scored) -> Scenario:
    """Return a variation of one of two flights, or of one that takes each parameter of either."""
    parents = most, nearest
    best = parents[int(rng.integers(2))]
    if rng.random() < CROSSED_SHARE:
        crossed = {name: parents[int(rng.integers(2))].scenario.values[name] for name in SPACE}
        best = replace(best, scenario=Scenario(crossed))
    return _varied(rng, best, FEW_CHANGES)


def _alone(rng: np.random.Generator, scenario: Scenario) -> Scenario:
    """Return a scenario, now and then without its fault or without its hazard if it has both."""
    is_spared = rng.random() < ALONE_SHARE
    name = ("fault", "hazard")[int(rng.integers(2))]
    both = not any(is_default(scenario, each) for each in ("fault", "hazard"))
    return scenario.replaced(name, DEFAULTS[name]) if both and is_spared else scenario


def _met(rng: np.random.Generator, scenario: Scenario, missed_m: float, missed_deg: float) -> Scenario:
    """Return a scenario with a hazard about where the vehicle came down."""
    values = dict(scenario.values)
    if is_default(scenario, "hazard"):
        values["hazard"] = some_hazard(rng)
    for name, value in (("hazard_aside_m", missed_m), ("hazard_aside_deg", missed_deg)):
        part = SPACE[name]
        assert isinstance(part, Range)
        values[name] = _near(name, part, value, rng)
    return Scenario(values)


def _changed(rng: np.random.Generator, scenario: Scenario, changes: tuple[int, int]) -> Scenario:
    """Return a scenario with a few of its acting parameters drawn again: near, or anywhere."""
    values = dict(scenario.values)
    for name in rng.choice(acting(scenario), int(rng.integers(*changes, endpoint=True)), replace=False):
        part = SPACE[str(name)]
        if isinstance(part, Choice) or rng.random() < 0.5:
            values[str(name)] = draw(part, rng)
        else:
            values[str(name)] = _near(str(name), part, float(values[str(name)]), rng)
    return Scenario(values)


def _near(name: str, part: Range, value: float, rng: np.random.Generator) -> float:
    span = part.high - part.low
    other = float(rng.normal(value, span * math.exp(rng.uniform(*np.log(NEAR)))))
    return rounded(part, (other - part.low) % span + part.low if is_angle(name) else other)
