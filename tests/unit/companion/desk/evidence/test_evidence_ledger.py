"""Runs are counted once, with the worst outcome that any artefact reports."""

from __future__ import annotations

from companion.desk.evidence.evidence_ledger import Entry, Ledger
from companion.desk.evidence.evidence_runs import Runs, Seeds, one, overlap, seeds_text
from tests.unit.companion.desk.evidence.results import NOW, OLD


def runs(seeds: Seeds, count: int = 1, failures: int = 0, program: str = NOW, variant: str = "a") -> Runs:
    return Runs("campaign", variant, seeds, program, count, failures, failures)


def counted(*reported: Runs) -> list[tuple[int, int, tuple[int, ...]]]:
    """Return runs, failures and artefacts of what is counted, each reported by an artefact of its own."""
    ledger = Ledger(NOW, [Entry(each, (k,)) for k, each in enumerate(reported)])
    return [(e.runs.runs, e.runs.failures, e.artefacts) for e in ledger.entries("campaign", "a")]


def test_other_seeds_are_other_runs() -> None:
    assert counted(runs(one(1)), runs(one(2)), runs(((3, 9),), 6)) == [
        (6, 0, (2,)),
        (1, 0, (0,)),
        (1, 0, (1,)),
    ]


def test_the_same_seed_in_two_artefacts_is_one_run() -> None:
    assert counted(runs(one(1)), runs(one(1))) == [(1, 0, (0, 1))]
    ledger = Ledger(NOW, [Entry(runs(one(1)), (k,)) for k in range(3)])
    assert ledger.repeated == {"flights": 2}
    assert ledger.left_out == {}


def test_a_run_that_failed_once_does_not_pass_by_a_repetition() -> None:
    assert counted(runs(one(1), failures=1), runs(one(1))) == [(1, 1, (0, 1))]
    assert counted(runs(one(1)), runs(one(1), failures=1)) == [(1, 1, (0, 1))]


def test_of_overlapping_sets_the_largest_counts_with_the_most_failures() -> None:
    assert counted(runs(((0, 100),), 100), runs(((50, 120),), 70, 2), runs(one(7), failures=1)) == [
        (100, 2, (0, 1, 2))
    ]


def test_of_sets_that_overlap_in_part_common_runs_are_repeated_and_the_others_left_out() -> None:
    sets = [runs(((0, 100),), 100), runs(((200, 300),), 100), runs(((90, 110), (290, 320)), 50)]
    ledger = Ledger(NOW, [Entry(each, (k,)) for k, each in enumerate(sets)])
    assert sum(e.runs.runs for e in ledger.entries("campaign")) == 200
    assert ledger.repeated == {"flights": 20}
    assert ledger.left_out == {"flights": 30}


def test_runs_of_another_version_or_variant_are_others() -> None:
    assert counted(runs(one(1)), runs(one(2), program=OLD), runs(one(1), variant="b")) == [(1, 0, (0,))]


def test_what_another_artefact_ran_is_not_skipped() -> None:
    skipped = Runs("test", "a", one(0), NOW, skipped=1)
    ledger = Ledger(NOW, [Entry(skipped, (0,)), Entry(Runs("test", "a", one(0), NOW), (1,))])
    assert [e.runs.skipped for e in ledger.entries("test")] == [0]


def test_ranges_of_seeds_overlap_and_are_told_in_words() -> None:
    assert overlap(((0, 5), (9, 12)), ((11, 20),))
    assert not overlap(((0, 5), (9, 12)), ((5, 9), (12, 13)))
    assert seeds_text(((5, 6), (0, 3), (3, 5), (9, 10))) == "0-5, 9"
