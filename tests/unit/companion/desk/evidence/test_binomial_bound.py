"""Upper bound of a failure's probability, against SciPy's binomial distribution."""

from __future__ import annotations

import pytest
from scipy.stats import binom

from companion.desk.evidence.binomial_bound import upper_bound


@pytest.mark.parametrize(("failures", "runs"), [(0, 1), (0, 10_000), (3, 2_000), (99, 100), (40, 55)])
@pytest.mark.parametrize("confidence", [0.95, 0.6])
def test_at_the_bound_so_few_failures_are_as_improbable_as_the_confidence_says(
    failures: int, runs: int, confidence: float
) -> None:
    bound = upper_bound(failures, runs, confidence)
    assert failures / runs < bound < 1.0
    assert binom.cdf(failures, runs, bound) == pytest.approx(1 - confidence, rel=1e-6)


def test_without_a_failure_it_is_about_three_in_all_runs_and_never_less_than_the_exact_one() -> None:
    assert upper_bound(0, 10_000) == pytest.approx(1 - 0.05 ** (1 / 10_000), rel=1e-9)
    assert upper_bound(0, 10_000) == pytest.approx(3 / 10_000, rel=0.002)
    assert upper_bound(0, 10_000) <= 0.0003


def test_nothing_is_known_without_a_run_or_where_every_run_failed() -> None:
    assert upper_bound(0, 0) == 1.0
    assert upper_bound(7, 7) == 1.0


@pytest.mark.parametrize(("failures", "runs", "confidence"), [(-1, 3, 0.95), (4, 3, 0.95), (0, 3, 1.0)])
def test_counts_that_cannot_be_are_refused(failures: int, runs: int, confidence: float) -> None:
    with pytest.raises(ValueError, match="failures of"):
        upper_bound(failures, runs, confidence)
