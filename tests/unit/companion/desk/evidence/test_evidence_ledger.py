"""Runs are counted once, with the worst outcome that any artefact reports."""

from __future__ import annotations

from itertools import permutations

import pytest
from scipy.stats import binom

from companion.desk.evidence.evidence_ledger import Entry, Ledger, Runs, Seeds, one, seeds_text
from companion.desk.evidence.safety_case import upper_bound
from tests.unit.companion.desk.evidence.results import NOW, OLD


def runs(seeds: Seeds, count: int = 1, failures: int = 0, program: str = NOW, variant: str = "a") -> Runs:
    return Runs("campaign", variant, seeds, program, count, failures, failures)


def counted(*reported: Runs) -> list[tuple[int, int, tuple[int, ...]]]:
    """Return runs, failures and artefacts of what is counted, each reported by an artefact of its own."""
    ledger = Ledger(NOW, [Entry(each, (k,)) for k, each in enumerate(reported)])
    return [(e.runs.runs, e.runs.failures, e.artefacts) for e in ledger.entries("campaign", "a")]


def test_other_seeds_are_other_runs() -> None:
    assert counted(runs(one(1)), runs(one(2), failures=1)) == [(1, 0, (0,)), (1, 1, (1,))]


def test_of_two_runs_of_one_seed_the_longer_counts() -> None:
    assert counted(runs(one(1), 500, 3), runs(one(1), 1_000)) == [(1_000, 3, (0, 1))]


def test_the_same_seed_in_two_artefacts_is_one_run() -> None:
    assert counted(runs(one(1)), runs(one(1))) == [(1, 0, (0, 1))]
    ledger = Ledger(NOW, [Entry(runs(one(1)), (k,)) for k in range(3)])
    assert ledger.repeated == {"flights": 2}
    assert ledger.left_out == {}


def test_a_run_that_failed_once_does_not_pass_by_a_repetition() -> None:
    assert counted(runs(one(1), failures=1), runs(one(1))) == [(1, 1, (0, 1))]
    assert counted(runs(one(1)), runs(one(1), failures=1)) == [(1, 1, (0, 1))]


def document(*seeds: tuple[int, int], unsafe: int = 0, landed: int | None = None, **box: int) -> list[Runs]:
    """Return the counts of a document; box: flights and unsafe ones that met a box."""
    flights = sum(end - first for first, end in seeds)
    landed = flights if landed is None else landed
    found = {("counts", "mine:"): (flights, unsafe), ("touchdowns", "mine"): (landed, unsafe)}
    if box:
        found["counts", "mine:box"] = (box["flights"], box["bad"])
    return [
        Runs(*key, seeds, NOW, runs, bad, bad, what=f"{bad} of {runs}") for key, (runs, bad) in found.items()
    ]


def settled(*documents: list[Runs]) -> tuple[Ledger, dict[str, list[tuple[int, int]]]]:
    """Return the ledger of documents and its runs and failures: of flights, touchdowns and boxes."""
    ledger = Ledger(NOW, [Entry(runs, (k,)) for k, each in enumerate(documents) for runs in each])
    keys = {"flights": ("counts", "mine:"), "landed": ("touchdowns", "mine"), "box": ("counts", "mine:box")}
    found = {
        name: [(e.runs.runs, e.runs.failures) for e in ledger.entries(*key)] for name, key in keys.items()
    }
    return ledger, found


def test_counts_without_common_seeds_are_all_counted() -> None:
    _, found = settled(document((0, 100), unsafe=1), document((100, 150), unsafe=2))
    assert found == {"flights": [(100, 1), (50, 2)], "landed": [(100, 1), (50, 2)], "box": []}


def test_of_overlapping_counts_flights_touchdowns_and_hazards_are_those_of_the_same_document() -> None:
    larger = document((0, 1_000), landed=10)
    smaller = document((900, 1_800), landed=900, flights=500, bad=0)
    ledger, found = settled(smaller, larger)
    assert found == {"flights": [(1_000, 0)], "landed": [(10, 0)], "box": []}
    assert ledger.repeated == {"flights": 100}
    assert ledger.left_out == {"flights": 800}


def test_failures_of_counts_that_are_left_out_are_added_as_far_as_they_may_be_others() -> None:
    larger = document((0, 1_000), unsafe=3, landed=900, flights=50, bad=1)
    smaller = document((998, 1_005), unsafe=6, landed=6, flights=6, bad=6)
    _, found = settled(larger, smaller)
    assert found == {"flights": [(1_000, 8)], "landed": [(900, 8)], "box": [(50, 6)]}


def test_a_failure_is_not_lost_where_the_counted_document_has_no_such_flights() -> None:
    smaller = document((0, 10), unsafe=4, landed=10, flights=4, bad=2)
    _, found = settled(document((0, 100), landed=0), smaller)
    assert found == {"flights": [(100, 4)], "landed": [(4, 4)], "box": [(2, 2)]}


def test_a_flight_whose_failure_is_known_is_not_counted_again() -> None:
    one_flight = document((5, 6), unsafe=1, flights=1, bad=1)
    ledger, found = settled(document((0, 100), unsafe=1, flights=1, bad=1), one_flight, one_flight)
    assert found == {"flights": [(100, 1)], "landed": [(100, 1)], "box": [(1, 1)]}
    assert ledger.repeated == {"flights": 2}
    assert ledger.left_out == {}


def test_counts_that_overlap_two_documents_are_compared_with_both() -> None:
    both = document((90, 110), (190, 210), unsafe=3)
    documents = [document((0, 100), unsafe=1), document((100, 200), unsafe=1), both, both]
    ledger, found = settled(*documents)
    assert found["flights"] == [(100, 4), (100, 1)]
    assert ledger.repeated == {"flights": 30 + 40}
    assert ledger.left_out == {"flights": 10}


def test_failures_that_two_documents_know_are_not_added_to_one_of_them() -> None:
    documents = [document((0, 100), unsafe=1), document((100, 200), unsafe=1)]
    _, found = settled(*documents, document((90, 110), unsafe=2))
    assert found["flights"] == [(100, 1), (100, 1)]


def test_the_order_of_overlapping_counts_does_not_matter() -> None:
    documents = [
        document((0, 100), unsafe=1, landed=90, flights=9, bad=1),
        document((50, 150), unsafe=1, landed=80, flights=8, bad=0),
        document((140, 200), unsafe=2),
        document((60, 61), unsafe=1, flights=1, bad=1),
    ]
    results = []
    for order in permutations(documents):
        ledger, found = settled(*order)
        results.append((found, ledger.repeated, ledger.left_out))
    assert all(each == results[0] for each in results)
    assert results[0][0]["landed"] == [(80, 4)]


def test_runs_of_another_version_or_variant_are_others() -> None:
    assert counted(runs(one(1)), runs(one(2), program=OLD), runs(one(1), variant="b")) == [(1, 0, (0,))]


def test_what_another_artefact_ran_is_not_skipped() -> None:
    skipped = Runs("test", "a", one(0), NOW, skipped=1)
    ledger = Ledger(NOW, [Entry(skipped, (0,)), Entry(Runs("test", "a", one(0), NOW), (1,))])
    assert [e.runs.skipped for e in ledger.entries("test")] == [0]


def test_ranges_of_seeds_are_told_in_words() -> None:
    assert seeds_text(((5, 6), (0, 3), (3, 5), (9, 10))) == "0-5, 9"


# Upper bound of a failure's probability, against SciPy's binomial distribution.


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
