"""How much worse a flight answered than what is known of it explains.

The time to an answer differs between flights without any weakness: what is tall or fast is seen sooner, and a
late link answers later. The latest of all are then soon the same few, and a weakness that makes an answer
half a second later is not seen among them. So a linear model of each part of the response is fitted to all
flights, by ridge regression in which outliers count little (Huber's weights); what it leaves, in standard
deviations of that part, is the surprise. Directions are not in it: nothing known depends on them. Flights
that vary one flight count together as about one, or the model would explain what the search lately looks at.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from tests.search.scenario import SPACE, Choice, Scenario, is_angle

RIDGE = 1.0  # flights that a weight of one counts as much as
LEAST_NOISE = 0.02  # of a response: 0.06 s or 5 cm
FITS, OUTLIER = 5, 1.5  # standard deviations beyond which a flight counts less
TO_DEVIATION = 1.4826  # standard deviation of a normal distribution, by its median distance


def surprises(
    scenarios: Sequence[Scenario], responses: Sequence[Mapping[str, float]]
) -> list[dict[str, float]]:
    """Return for each flight the surprise by the parts of its response: less is worse."""
    known = np.array([_known(scenario) for scenario in scenarios])
    weights = _weights(scenarios)
    left: list[dict[str, float]] = [{} for _ in scenarios]
    for name in sorted({name for response in responses for name in response}):
        rows = [number for number, response in enumerate(responses) if name in response]
        found = np.array([responses[number][name] for number in rows])
        for number, value in zip(rows, _surprise(known[rows], found, weights[rows]), strict=True):
            left[number][name] = round(float(value), 5)
    return left


def _known(scenario: Scenario) -> list[float]:
    """Return what may explain a response: numbers as shares of their ranges, each choice as 0 or 1."""
    known = []
    for name, part in SPACE.items():
        value = scenario.values[name]
        if isinstance(part, Choice):
            known += [float(value == other) for other in part.values[1:]]
        elif not is_angle(name) and not part.whole:
            known.append((float(value) - part.low) / (part.high - part.low))
    return known


def _weights(scenarios: Sequence[Scenario]) -> Any:
    """Return the median of 1 / number of flights with the same value, over the numbers of each scenario."""
    names = [name for name, part in SPACE.items() if not isinstance(part, Choice) and not part.whole]
    shares = []
    for name in names:
        _, which, counts = np.unique(
            [scenario.number(name) for scenario in scenarios], return_inverse=True, return_counts=True
        )
        shares.append(1.0 / counts[which])
    return np.median(shares, axis=0)


def _surprise(known: Any, found: Any, weights: Any) -> Any:
    """Return the residuals of the fit in their standard deviations."""
    trusted = weights
    for _ in range(FITS):
        off = found - _expected(known, found, trusted)
        noise = max(LEAST_NOISE, TO_DEVIATION * _median(np.abs(off), weights))
        trusted = weights * np.minimum(1.0, OUTLIER * noise / np.maximum(np.abs(off), LEAST_NOISE))
    return off / noise


def _median(values: Any, weights: Any) -> float:
    order = np.argsort(values)
    return float(values[order][np.searchsorted(np.cumsum(weights[order]), weights.sum() / 2)])


def _expected(known: Any, found: Any, weights: Any) -> Any:
    """Return the fitted values of a weighted ridge regression with a free mean."""
    mean = weights @ found / weights.sum()
    centred = known - weights @ known / weights.sum()
    square = (centred.T * weights) @ centred + RIDGE * np.eye(known.shape[1])
    return mean + centred @ np.linalg.solve(square, (centred.T * weights) @ (found - mean))
