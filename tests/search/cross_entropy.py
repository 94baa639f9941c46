"""Cross-entropy search: draw scenarios, keep the best, draw the next ones near them (Rubinstein 1999).

Numbers are drawn from normal distributions, angles from wrapped ones, choices by weights. A share of each
generation is drawn evenly, so that nothing is ruled out, and a share are small changes of one of the best.
There are best ones of each end: landings close to a hazard must not crowd out the late break-offs, from
which the way to a failure may be shorter.
"""

from __future__ import annotations

import cmath
import math
from collections.abc import Sequence

import numpy as np

from tests.search.scenario import SPACE, Choice, Range, Scenario, Value, draw, rounded, uniform

Scored = tuple[float, str, Scenario]
"""Score, end and scenario of a flight."""
EVEN_SHARE, CHANGED_SHARE = 0.05, 0.45
ELITE = 6
FIRST = 20  # flights before anything is learnt
LEAST_SPREAD, LEAST_WEIGHT = 0.06, 0.05
CHANGES = (1, 4)  # parameters of one of the best that are drawn again
NEAR = 0.12  # of a range: a change that is none to somewhere else


def next_generation(rng: np.random.Generator, flown: Sequence[Scored], count: int) -> list[Scenario]:
    """Return the scenarios to fly next; evenly drawn ones while too few are flown."""
    if len(flown) < FIRST:
        return [uniform(rng) for _ in range(count)]
    ends = sorted({end for _, end, _ in flown})
    ranked = sorted(flown, key=lambda one: one[0])
    best = [[scenario for _, end, scenario in ranked if end == each][:ELITE] for each in ends]
    return [_one(rng, best[int(rng.integers(len(best)))]) for _ in range(count)]


def _one(rng: np.random.Generator, best: Sequence[Scenario]) -> Scenario:
    kind = rng.random()
    if kind < EVEN_SHARE:
        return uniform(rng)
    if kind < EVEN_SHARE + CHANGED_SHARE:
        return _changed(rng, best[int(rng.integers(len(best)))])
    return Scenario({name: _near_all(rng, name, [one.values[name] for one in best]) for name in SPACE})


def _changed(rng: np.random.Generator, scenario: Scenario) -> Scenario:
    """Return a scenario with a few parameters drawn again: near, or anywhere."""
    values = dict(scenario.values)
    for name in rng.choice(list(SPACE), int(rng.integers(*CHANGES, endpoint=True)), replace=False):
        part = SPACE[str(name)]
        if isinstance(part, Choice) or rng.random() < 0.5:
            values[str(name)] = draw(part, rng)
        else:
            values[str(name)] = _placed(str(name), part, float(values[str(name)]), NEAR, rng)
    return Scenario(values)


def _near_all(rng: np.random.Generator, name: str, values: Sequence[Value]) -> Value:
    """Draw a parameter from the distribution of its values among the best."""
    part = SPACE[name]
    if isinstance(part, Choice):
        weights = np.array(
            [LEAST_WEIGHT + sum(v == each for v in values) / len(values) for each in part.values]
        )
        return part.values[int(rng.choice(len(weights), p=weights / weights.sum()))]
    numbers = np.array([float(v) for v in values])
    span = part.high - part.low
    if not is_angle(name):
        return _placed(name, part, float(numbers.mean()), max(LEAST_SPREAD, float(numbers.std()) / span), rng)
    mean = complex(np.exp(2j * np.pi * (numbers - part.low) / span).mean())
    spread = math.sqrt(max(0.0, -2.0 * math.log(max(abs(mean), 1e-9)))) / (2 * math.pi)
    middle = part.low + cmath.phase(mean) / (2 * math.pi) * span
    return _placed(name, part, middle, max(LEAST_SPREAD, spread), rng)


def _placed(name: str, part: Range, middle: float, spread: float, rng: np.random.Generator) -> float:
    span = part.high - part.low
    value = float(rng.normal(middle, spread * span))
    return rounded(part, (value - part.low) % span + part.low if is_angle(name) else value)


def is_angle(name: str) -> bool:
    """Return whether a parameter wraps around."""
    return name.endswith("_deg")
