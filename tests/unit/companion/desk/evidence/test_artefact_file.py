"""Artefacts: recognised by their content, or refused in one line that names the place."""

from __future__ import annotations

import hashlib
import json
from pathlib import Path
from typing import Any

import pytest
from _pytest.junitxml import LogXML, xml_key

from companion.desk.evidence.artefact_file import read_artefact
from companion.desk.evidence.landing_counts import counts_document
from companion.runtime.errors import UsageError
from companion.runtime.program_version import program_version
from tests.conftest import pytest_sessionstart
from tests.unit.companion.desk.evidence.results import (
    NOW,
    artefact,
    campaign_flight,
    case,
    counts,
    junit,
    landing,
    written,
)


def fuzz(*harnesses: object) -> dict[str, Any]:
    return {"format": "slz-fuzz", "version": 1, "program": NOW, "seed": 7, "harnesses": harnesses}


SOAK = {"hours": 24.0, "reports": 9, "rss_growth": 0.0, "failed": [], "came_of": {"safe": 50, "unsafe": 1},
        "clock": "simulated", "seed": 1, "program": NOW}  # fmt: skip


def ends(**of: int) -> dict[str, int]:
    """Return the counts of a hazard."""
    return {"flights": sum(of.values()), "safe": 0, "refused": 0, "aborted": 0, "unsafe": 0} | of


def numbers(path: Path) -> dict[str, tuple[int, int, int, int]]:
    """Return runs, failures, unsafe and skipped by source and variant."""
    found: dict[str, tuple[int, int, int, int]] = {}
    for r in read_artefact(path).runs:
        before = found.get(f"{r.source} {r.variant}", (0, 0, 0, 0))
        more = (r.runs, r.failures, r.unsafe, r.skipped)
        runs, failures, unsafe, skipped = (a + b for a, b in zip(before, more, strict=True))
        found[f"{r.source} {r.variant}"] = (runs, failures, unsafe, skipped)
    return found


def test_tests_pass_fail_and_are_skipped(tmp_path: Path) -> None:
    cases = case("test_a[1]") + case("test_b", "<failure message='no'/>") + case("test_c", "<skipped/>")
    read = artefact(tmp_path, "junit.xml", junit(cases + case("test_d", "<error message='broken'/>")))
    assert read.kind == "test"
    assert read.programs() == [NOW]
    assert [(r.variant.partition("::")[2], r.failures, r.skipped, r.what) for r in read.runs] == [
        ("test_a[1]", 0, 0, ""),
        ("test_b", 1, 0, "no"),
        ("test_c", 0, 1, ""),
        ("test_d", 1, 0, "broken"),
    ]
    assert read.runs[0].variant == "tests/unit/test_a.py::test_a[1]"


def test_the_digest_is_that_of_the_file(tmp_path: Path) -> None:
    path = written(tmp_path, "flights.jsonl", campaign_flight(0))
    assert read_artefact(path).sha256 == hashlib.sha256(path.read_bytes()).hexdigest()


def test_flights_of_the_campaign_are_judged_by_what_they_record(tmp_path: Path) -> None:
    late = campaign_flight(1, not_as_stated=["still in final"])
    unsafe = campaign_flight(2, safe=False, not_as_stated=["touched unsafe ground"])
    pilots = campaign_flight(3, safe=False, landed_by="pilot")
    against = campaign_flight(4, commands_while_pilot_flies=2, touchdown=None, safe=None)
    hit = campaign_flight(5, touchdown=None, safe=None, collision={"e": 0.0})
    path = written(tmp_path, "flights.jsonl", campaign_flight(0), late, unsafe, pilots, against, hit)
    assert numbers(path) == {
        "campaign lidar_stop": (6, 4, 3, 0),
        "touchdowns campaign": (3, 1, 1, 0),
        "collisions campaign": (5, 1, 1, 0),
        "commands campaign": (6, 1, 1, 0),
        "by_others campaign": (1, 1, 1, 0),
    }


def test_a_bad_end_under_the_pilot_or_a_failsafe_is_named_and_not_the_companions(tmp_path: Path) -> None:
    hit = campaign_flight(1, landed_by="failsafe", touchdown=None, safe=None, collision={"e": 0.0})
    tipped = campaign_flight(2, landed_by="pilot", safe=False, collision={"e": 0.0})
    read = artefact(tmp_path, "flights.jsonl", campaign_flight(0, landed_by="pilot"), hit, tipped)
    assert [(r.failures, r.what) for r in read.runs if r.source == "by_others"] == [
        (0, ""),
        (1, "campaign 1: collided (failsafe)"),
        (1, "campaign 2: touched unsafe ground; collided (pilot)"),
    ]
    assert {r.source for r in read.runs if r.source in ("collisions", "touchdowns")} == set()
    assert [r.failures for r in read.runs if r.source == "campaign"] == [0, 0, 0]


def test_flights_of_the_landing_benchmark_are_trials_of_their_hazard_only_where_it_came(
    tmp_path: Path,
) -> None:
    flights = [
        landing(0),
        landing(1, hazard_arrived=False),
        landing(2, safe=False),
        landing(3, crossing={"late": True, "needless": 0}),
        landing(4, error_m=None, landed=False, safe=False, failure="in climb after 600 s"),
    ]
    assert numbers(written(tmp_path, "landings.json", *flights)) == {
        "landings hazard": (5, 3, 1, 1),
        "touchdowns landings hazard": (4, 1, 1, 0),
        "collisions landings hazard": (5, 0, 0, 0),
        "commands landings hazard": (5, 0, 0, 0),
    }


def test_a_soak_is_one_run_and_its_landings_are_touchdowns(tmp_path: Path) -> None:
    path = written(tmp_path, "simulated.json", SOAK | {"failed": ["memory"]})
    assert numbers(path) == {"soak simulated": (1, 1, 0, 0), "touchdowns soak simulated": (51, 1, 1, 0)}


def test_inputs_of_each_harness_are_counted(tmp_path: Path) -> None:
    harnesses = [
        {"name": "livox", "inputs": 500, "failed": 0, "ok": True, "grew": False, "failures": []},
        {
            "name": "las",
            "inputs": 10,
            "failed": 7,
            "ok": False,
            "grew": False,
            "failures": ["IndexError: no"],
        },
    ]
    path = written(tmp_path, "fuzz.json", fuzz(*harnesses))
    assert numbers(path) == {"fuzz livox": (500, 0, 0, 0), "fuzz las": (10, 7, 0, 0)}
    assert [r.at_least for r in read_artefact(path).runs] == [False, False]


@pytest.mark.parametrize(
    ("harness", "failures", "said"),
    [
        ({"ok": False, "failures": ["KeyError: 'x'", "a"]}, 2, "las, seed 7: KeyError: 'x'"),
        ({"ok": False, "failures": []}, 1, "las, seed 7: memory grew"),
        ({"ok": False, "grew": True, "failed": 3, "failures": ["a"]}, 3, "las, seed 7: a; memory grew"),
        ({"ok": False, "inputs": 0, "failures": ["crash at start"]}, 1, "las, seed 7: crash at start"),
    ],
)
def test_without_the_number_of_failed_inputs_and_with_grown_memory_at_least_so_many_failed(
    tmp_path: Path, harness: dict[str, Any], failures: int, said: str
) -> None:
    run = artefact(tmp_path, "fuzz.json", fuzz({"name": "las", "inputs": 1_000} | harness)).runs[0]
    assert (run.failures, run.what, run.at_least) == (failures, said, True)


def test_counts_of_any_tool_are_flights_landings_touchdowns_and_hazards(tmp_path: Path) -> None:
    assert numbers(written(tmp_path, "counts.json", counts(safe=9_988, unsafe=2))) == {
        "counts search:": (10_000, 2, 2, 0),
        "begun search": (9_994, 2, 2, 0),
        "touchdowns search": (9_990, 2, 2, 0),
        "counts search:box": (100, 0, 0, 0),
    }
    made = counts_document("mine", [(0, 5)], {"safe": 4, "aborted": 1}, {"post": {"safe": 1}})
    read = artefact(tmp_path, "mine.json", json.dumps(made, indent=1))
    assert read.programs() == [program_version()]
    assert read.count(program_version()) == 5


def test_seeds_of_counts_may_have_gaps_and_come_in_any_order(tmp_path: Path) -> None:
    path = written(tmp_path, "counts.json", counts(seeds=[[9_000, 12_000], [0, 6_000], [6_000, 7_000]]))
    assert numbers(path)["counts search:"] == (10_000, 0, 0, 0)


def test_a_report_of_tests_records_the_version(tmp_path: Path) -> None:
    log = LogXML(str(tmp_path / "junit.xml"), None)

    class Session:
        config = type("Settings", (), {"stash": {xml_key: log}})

    pytest_sessionstart(Session())  # type: ignore[arg-type]
    assert log.global_properties == [("slz_program", program_version())]


def test_results_made_before_versions_were_recorded_are_of_an_unknown_one(tmp_path: Path) -> None:
    old_flight = {k: v for k, v in campaign_flight(0).items() if k not in ("program", "not_as_stated")}
    old_landing = {k: v for k, v in landing(0).items() if k not in ("program", "kind")}
    old_soak = {k: v for k, v in SOAK.items() if k not in ("program", "clock", "seed")}
    for name, old in (("a", old_flight), ("b", old_landing), ("c", old_soak), ("d", junit(case("t"), ""))):
        read = artefact(tmp_path, name, old)
        assert read.programs() == [""]
        assert "made before versions were recorded" in read.notes[-1]


def test_a_flight_whose_judgement_is_no_list_is_of_an_unknown_version(tmp_path: Path) -> None:
    assert artefact(tmp_path, "flights.jsonl", campaign_flight(0, not_as_stated=5)).programs() == [""]


def test_a_last_line_cut_short_is_left_out_and_said(tmp_path: Path) -> None:
    path = written(tmp_path, "flights.jsonl", campaign_flight(0))
    path.write_text(path.read_text("utf-8") + '{"number": 1, "fau', "utf-8")
    read = read_artefact(path)
    assert read.count(NOW) == 1
    assert read.notes == ["the last line is cut off and left out"]


@pytest.mark.parametrize(
    ("content", "said"),
    [
        ("", "it is empty"),
        ("hello", "no JSON"),
        ("[1]", "a JSON object was expected"),
        ('{"a": 1}', "no result of tests, campaign, landings, fuzz or soak"),
        ("<html/>", "<html> is no JUnit report"),
        ("<testsuites>", "no XML"),
        ("<!DOCTYPE x><testsuites/>", "definitions of its own"),
        (junit(""), "it holds no run"),
        (json.dumps(campaign_flight(0)) + "\nnonsense\n", "line 2: no JSON"),
        (f"{json.dumps(campaign_flight(0))}\n{json.dumps(landing(0))}\n", "line 2: no flight of campaign"),
        (json.dumps(campaign_flight(-1)), "'number' is -1: a whole number from 0 to 2^64 was expected"),
        (json.dumps(campaign_flight(2**64 + 1)), "a whole number from 0 to 2^64 was expected"),
        (json.dumps(campaign_flight(0, commands_while_pilot_flies=10**12 + 1)), "from 0 to 10^12 was"),
        (json.dumps(campaign_flight(0)) + '\n{"number": ' + "9" * 5_000, "line 2: JSON that cannot be read"),
        ('{"a": ' + "[" * 100_000 + "]" * 100_000 + "}", "JSON that cannot be read: maximum recursion"),
        (json.dumps(campaign_flight(0, fault="\ud800")), "\\ud800 is half a character (a lone surrogate)"),
        (json.dumps(campaign_flight(0)) + "\n" + json.dumps(campaign_flight(1, not_as_stated=["\udfff"])),
         "line 2: \\udfff is half a character"),
        (json.dumps(counts(by_hazard={"\ud800": ends()}), indent=1), "\\ud800 is half a character"),
        (json.dumps(counts(seeds=[[10**300, 10**300 + 10_000]])), "ranges [first, last + 1] of whole"),
        (json.dumps(counts(flights=10**400, safe=10**400)), "a whole number from 0 to 10^12 was expected"),
        (json.dumps(counts(version=2)), "'version' is 2: 1 was expected"),
        (json.dumps(counts(safe=9_991)), "'flights' is 10000: the sum of the ends, 10001, was expected"),
        (json.dumps(counts(seeds=[[5, 5]])), "ranges [first, last + 1]"),
        (json.dumps(counts(seeds=[[0, 9]])), "'flights' is 10000: one flight for each seed, 9, was"),
        (json.dumps(counts(seeds=[[0, 10_001]])), "one flight for each seed, 10001, was expected"),
        (json.dumps(counts(sampling="adaptive", seeds=[[0, 9]])), "one flight for each seed, 9, was"),
        (json.dumps(counts(seeds=[[0, 1]] * 10_000)), "'seeds' [0, 1] and [0, 1] overlap: a seed is one"),
        (json.dumps(counts(seeds=[[2_000, 6_000], [0, 6_000]])), "[0, 6000] and [2000, 6000] overlap"),
        (json.dumps(counts(by_hazard={"box": ends(safe=9, unsafe=1)})),
         "'box': 'unsafe' is 1: at most the 0 of all flights was expected"),
        (json.dumps(counts(by_hazard={"box": ends(safe=20_000)})),
         "'box': 'flights' is 20000: at most the 10000 of all flights was expected"),
        (json.dumps(counts(by_hazard={"box": ends(refused=7)})), "'refused' is 7: at most the 6 of all"),
        (json.dumps(counts(tool="campaign")), "'tool' is 'campaign'"),
        (json.dumps(counts(tool="")), "'tool' is ''"),
        (json.dumps(counts(tool=" ")), "'tool' is ' '"),
        (json.dumps(counts()).replace('"unsafe": 0', '"unsafe": 1, "unsafe": 0'),
         "the key 'unsafe' is there twice in one object: keep one"),
        (json.dumps(counts(), indent=1).replace('"unsafe": 0', '"unsafe": 1, "unsafe": 0'),
         "the key 'unsafe' is there twice in one object: keep one"),
        (json.dumps(campaign_flight(0))[:-1] + ', "safe": true}\n' + json.dumps(campaign_flight(1)),
         "the key 'safe' is there twice"),
        (json.dumps(campaign_flight(0)) + "\n" + json.dumps(campaign_flight(1))[:-1] + ', "safe": true}',
         "line 2: the key 'safe' is there twice"),
        (json.dumps(counts(sampling="some")), "independent or adaptive was expected"),
        (json.dumps(counts(by_hazard={"a": 1})), "'a' is 1: an object was expected"),
        (json.dumps(fuzz(3)), "harness 1: 'name' is missing"),
        (json.dumps(fuzz() | {"version": 9}), "'version' is 9: 1 was expected"),
        (json.dumps(fuzz() | {"version": True}), "'version' is True: 1 was expected"),
        (json.dumps(fuzz({"name": "las", "inputs": 9, "failed": 1, "failures": ["a", "b"]})),
         "harness 1: 'failed' is 1: a number from 2 to 9, by 'failures' and 'inputs', was expected"),
        (json.dumps(fuzz({"name": "las", "inputs": 9, "failed": 10, "failures": ["a"]})), "'failed' is 10"),
        (json.dumps(fuzz({"name": "las", "inputs": 9, "failed": 1, "failures": []})), "from 0 to 0"),
    ],
)  # fmt: skip
def test_what_is_no_artefact_is_one_line_with_the_file_and_the_fault(
    tmp_path: Path, content: str, said: str
) -> None:
    path = tmp_path / "bad"
    path.write_text(content, "utf-8")
    with pytest.raises(UsageError) as refused:
        read_artefact(path)
    text = str(refused.value)
    assert text.startswith(f"--artefact {path}")
    assert said in text
    assert "\n" not in text


def test_a_file_that_is_not_there_or_no_text_is_one_line(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="No such file"):
        read_artefact(tmp_path / "none")
    (tmp_path / "picture").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(UsageError, match="no text in UTF-8"):
        read_artefact(tmp_path / "picture")
