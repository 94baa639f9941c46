"""State of each hazard's evidence, and its bounds."""

from __future__ import annotations

from pathlib import Path

import pytest

from companion.desk.evidence.safety_case import SafetyCase, State, make_case, upper_bound
from tests.unit.companion.desk.evidence.results import (
    NOW,
    OLD,
    artefact,
    campaign_flight,
    case,
    counts,
    hazard,
    junit,
    landing,
)

NODE = "tests/unit/test_a.py::test_a"


def of(folder: Path, *documents: object, **links: tuple[str, ...]) -> SafetyCase:
    """Return the case of one hazard, each document in an artefact of its own."""
    return make_case([hazard(**links)], [artefact(folder, f"a{k}", d) for k, d in enumerate(documents)], NOW)


def test_a_hazard_without_a_run_has_no_evidence() -> None:
    found = make_case([hazard(tests=(NODE,), campaign=("lidar_stop",))], [], NOW)
    assert found.hazards[0].state is State.NONE
    assert [(f.label, f.runs, f.failed_bound) for f in found.hazards[0].findings] == [
        (NODE, 0, None),
        ("campaign lidar_stop", 0, None),
    ]


def test_a_test_that_was_skipped_is_no_evidence(tmp_path: Path) -> None:
    found = of(tmp_path, junit(case("test_a", "<skipped/>")), tests=(NODE,)).hazards[0]
    assert (found.state, found.findings[0].runs, found.findings[0].skipped) == (State.NONE, 0, 1)


def test_a_hazard_of_which_one_link_has_no_run_has_evidence_in_part(tmp_path: Path) -> None:
    found = of(tmp_path, junit(case("test_a[1]") + case("test_a[2]")), tests=(NODE,), fuzz=("livox",))
    assert found.hazards[0].state is State.PARTIAL
    assert [f.runs for f in found.hazards[0].findings] == [2, 0]


def test_cases_of_a_test_and_all_tests_of_a_file_are_counted_and_none_beside(tmp_path: Path) -> None:
    cases = junit(case("test_a[1]") + case("test_a[2]") + case("test_ab"))
    found = of(tmp_path, cases, tests=(NODE, "tests/unit/test_a.py", "tests/unit/test")).hazards[0]
    assert [f.runs for f in found.findings] == [2, 3, 0]


def test_tests_have_no_bound_and_random_flights_have_one(tmp_path: Path) -> None:
    flights = [artefact(tmp_path, "log", *(campaign_flight(n) for n in range(60)))]
    tests = artefact(tmp_path, "junit", junit(case("test_a")))
    found = make_case([hazard(tests=(NODE,), campaign=("lidar_stop",))], [*flights, tests], NOW).hazards[0]
    assert found.state is State.SHOWN
    assert [f.failed_bound for f in found.findings] == [None, upper_bound(0, 60)]


def test_a_failing_flight_fails_its_hazard_and_an_unsafe_one_makes_it_unsafe(tmp_path: Path) -> None:
    late = campaign_flight(1, not_as_stated=["still in final"])
    unsafe = campaign_flight(2, safe=False)
    failed = of(tmp_path, late, campaign=("lidar_stop",)).hazards[0]
    assert failed.state is State.FAILED
    assert failed.findings[0].failures_named == ("campaign 1: still in final",)
    worse = of(tmp_path, late, unsafe, campaign=("lidar_stop",), measures=("touchdowns",)).hazards[0]
    assert worse.state is State.UNSAFE
    assert [(f.runs, f.failures, f.unsafe) for f in worse.findings] == [(2, 2, 1), (2, 1, 1)]
    assert worse.findings[0].unsafe_bound == upper_bound(1, 2)


def test_failures_come_first_then_what_has_no_evidence(tmp_path: Path) -> None:
    listed = [
        hazard(1, tests=(NODE,)),
        hazard(2, tests=(NODE,), fuzz=("las",)),
        hazard(3, fuzz=("las",)),
        hazard(4, landings=("hazard",)),
        hazard(5, campaign=("lidar_stop",)),
    ]
    late = campaign_flight(1, not_as_stated=["x"])
    read = [artefact(tmp_path, f"a{k}", each) for k, each in
            enumerate([junit(case("test_a")), landing(0, collision="wall"), late])]  # fmt: skip
    found = make_case(listed, read, NOW)
    assert [each.hazard.id for each in found.hazards] == ["H04", "H05", "H03", "H02", "H01"]


def test_the_same_flight_in_two_artefacts_is_counted_once(tmp_path: Path) -> None:
    found = of(tmp_path, campaign_flight(1), campaign_flight(1), campaign=("lidar_stop",))
    assert [(f.runs, f.artefacts) for f in found.hazards[0].findings] == [(1, (0, 1))]
    assert found.repeated == {"flights": 1}
    assert [(f.label, f.runs) for f in found.measures] == [
        ("touchdowns", 1),
        ("collisions", 1),
        ("commands", 1),
    ]


def test_a_flight_that_is_repeated_is_one_whatever_it_is_counted_as(tmp_path: Path) -> None:
    part = counts(seeds=[[8_000, 18_000]])
    found = of(tmp_path, counts(), part, counts=("box",), measures=("touchdowns",))
    assert found.repeated == {"flights": 2_000}
    assert found.left_out == {"flights": 8_000}


def test_equal_counts_by_another_tool_are_named(tmp_path: Path) -> None:
    copy = counts(tool="copy", by_hazard={})
    assert of(tmp_path, counts(), copy).equal_counts == ((0, "search", 1, "copy"),)
    others = [
        {"environment": "flight"},
        {"seeds": [[1, 10_001]]},
        {"program": OLD},
        {"safe": 9_989, "aborted": 5},
    ]
    for other in others:
        assert of(tmp_path, counts(), copy | other).equal_counts == ()
    assert of(tmp_path, counts(), counts()).equal_counts == ()


def test_runs_of_another_version_do_not_count(tmp_path: Path) -> None:
    found = of(tmp_path, campaign_flight(1, program=OLD, safe=False), campaign=("lidar_stop",))
    assert found.hazards[0].state is State.NONE
    assert found.measures == ()


def test_touchdowns_of_all_kinds_are_one_measure_with_its_bound(tmp_path: Path) -> None:
    found = of(tmp_path, counts(), landing(1), campaign_flight(1), measures=("touchdowns",)).hazards[0]
    assert [(f.runs, f.unsafe_bound) for f in found.findings] == [(9_992, upper_bound(0, 9_992))]


@pytest.mark.parametrize("name", ["box", "H01", "lidar_stop"])
def test_counts_by_hazard_belong_to_its_name_its_id_and_its_faults(tmp_path: Path, name: str) -> None:
    part = {"flights": 7, "safe": 7, "refused": 0, "aborted": 0, "unsafe": 0}
    found = of(tmp_path, counts(by_hazard={name: part}), counts=("box",), campaign=("lidar_stop",))
    assert ("search " + name, 7) in [(f.label, f.runs) for f in found.hazards[0].findings]
    assert found.unknown_counts == ()


def test_counts_of_no_hazard_are_named(tmp_path: Path) -> None:
    assert of(tmp_path, counts(), counts=("post",)).unknown_counts == ("search:box",)


def test_an_adaptive_search_has_no_bound_and_takes_it_from_no_other_flights(tmp_path: Path) -> None:
    adaptive = counts(sampling="adaptive", tool="worst")
    found = of(tmp_path, adaptive, counts(), counts=("box",), measures=("touchdowns",)).hazards[0]
    assert [(f.label, f.runs, f.unsafe_bound) for f in found.findings] == [
        ("touchdowns", 9_990, upper_bound(0, 9_990)),
        ("touchdowns", 9_990, None),
        ("search box", 100, upper_bound(0, 100)),
        ("worst box", 100, None),
    ]


def test_an_adaptive_search_that_has_flights_of_a_document_takes_its_bound(tmp_path: Path) -> None:
    some = {"seeds": [[0, 100]], "flights": 100, "safe": 100, "refused": 0, "aborted": 0, "by_hazard": {}}
    found = of(tmp_path, counts(), counts(sampling="adaptive", **some), measures=("touchdowns",)).hazards[0]
    assert [(f.runs, f.unsafe_bound) for f in found.findings] == [(9_990, None)]


def test_real_flights_are_never_counted_with_simulated_ones(tmp_path: Path) -> None:
    real = counts(tool="field", environment="flight")
    found = of(tmp_path, counts(), real, measures=("touchdowns",)).hazards[0]
    assert sorted((f.environment, f.runs) for f in found.findings) == [
        ("flight", 9_990),
        ("simulation", 9_990),
    ]


def test_the_number_of_links_does_not_depend_on_the_artefacts(tmp_path: Path) -> None:
    asked: dict[str, tuple[str, ...]] = {"tests": (NODE,), "fuzz": ("las",), "measures": ("touchdowns",)}
    real = counts(tool="field", environment="flight")
    found = [of(tmp_path, *some, counts=("box",), **asked).hazards[0] for some in ([], [counts(), real])]
    assert [(each.links(), each.counts_with_runs()) for each in found] == [((0, 3), 0), ((1, 3), 2)]


def test_failures_that_belong_to_no_hazard_are_named(tmp_path: Path) -> None:
    found = of(tmp_path, junit(case("test_b", "<failure message='no'/>")), tests=(NODE,))
    assert [(f.label, f.failures_named) for f in found.unlinked] == [
        ("test tests/unit/test_a.py::test_b", ("no",))
    ]


def test_the_unsafe_flights_of_counts_belong_to_a_hazard_that_asks_for_touchdowns(tmp_path: Path) -> None:
    unsafe = counts(safe=9_989, unsafe=1)
    assert of(tmp_path, unsafe, counts=("box",), measures=("touchdowns",)).unlinked == ()
    assert [f.label for f in of(tmp_path, unsafe, counts=("box",)).unlinked] == ["counts search"]


def test_flights_that_others_brought_down_are_a_measure_that_makes_no_hazard_unsafe(tmp_path: Path) -> None:
    badly = campaign_flight(1, landed_by="pilot", safe=False)
    found = of(tmp_path, campaign_flight(0, landed_by="failsafe"), badly, campaign=("lidar_stop",))
    assert [(f.label, f.runs, f.unsafe) for f in found.measures] == [("commands", 2, 0), ("by_others", 2, 1)]
    assert (found.hazards[0].state, found.unlinked) == (State.SHOWN, ())


def test_failures_of_unknown_number_have_no_bound_also_with_other_runs(tmp_path: Path) -> None:
    def fuzzed(seed: int, **more: object) -> dict[str, object]:
        harness = {"name": "las", "inputs": 100, "ok": True, "failures": []} | more
        return {"format": "slz-fuzz", "version": 1, "program": NOW, "seed": seed, "harnesses": [harness]}

    half = fuzzed(1, ok=False, failed=50, failures=["KeyError: 'x'"])
    told = of(tmp_path, half, fuzzed(2), fuzz=("las",)).hazards[0].findings[0]
    assert (told.runs, told.failures, told.failed_bound) == (200, 50, upper_bound(50, 200))
    unknown = fuzzed(1, ok=False, failures=["KeyError: 'x'"])
    found = of(tmp_path, unknown, fuzzed(2), fuzz=("las",)).hazards[0].findings
    assert [(f.runs, f.failures, f.at_least, f.failed_bound) for f in found] == [(200, 1, True, None)]
    again = fuzzed(2, inputs=50, ok=False, failures=["KeyError: 'x'"])
    found = of(tmp_path, fuzzed(2), again, fuzz=("las",)).hazards[0].findings
    assert [(f.runs, f.failures, f.at_least) for f in found] == [(100, 1, True)]


def test_a_harness_that_failed_before_its_first_input_fails(tmp_path: Path) -> None:
    crashed = {"name": "las", "inputs": 0, "ok": False, "failures": ["crash at start"]}
    made = {"format": "slz-fuzz", "version": 1, "program": NOW, "seed": 1, "harnesses": [crashed]}
    found = of(tmp_path, made, fuzz=("las",)).hazards[0]
    assert (found.state, found.findings[0].failures, found.links()) == (State.FAILED, 1, (0, 1))


def test_of_many_failures_the_first_are_named(tmp_path: Path) -> None:
    flights = [campaign_flight(n, not_as_stated=["x"]) for n in range(15)]
    found = of(tmp_path, *flights, campaign=("lidar_stop",)).hazards[0].findings[0]
    assert found.failures_named[-1] == "and 5 more"
    assert len(found.failures_named) == 11
