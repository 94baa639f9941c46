"""Upper confidence bound of a probability, from a count of failures."""

from __future__ import annotations

from scipy.special import betaincinv

CONFIDENCE = 0.95


def upper_bound(failures: int, runs: int, confidence: float = CONFIDENCE) -> float:
    """Return the one-sided Clopper-Pearson upper bound of the probability of a failure.

    It is the probability of a failure at which `failures` or fewer of `runs` have the probability
    1 - confidence. Without a failure it is 1 - (1 - confidence)^(1/runs), about 3/runs at 95 %. Without a run
    it is 1: nothing is known.

    Raises
    ------
    ValueError
        The counts or the confidence cannot be.
    """
    if not 0 <= failures <= runs or not 0.0 < confidence < 1.0:
        raise ValueError(f"{failures} failures of {runs} runs at a confidence of {confidence}")
    if failures == runs:
        return 1.0
    return float(betaincinv(failures + 1, runs - failures, confidence))
