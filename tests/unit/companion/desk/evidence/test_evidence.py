"""`slz evidence`: its page, Markdown and JSON."""

from __future__ import annotations

import json
import os
import re
import sys
from pathlib import Path

import pytest

from companion.cli import program
from companion.desk import evidence
from companion.desk.evidence.case_report import share
from companion.desk.evidence.hazard_list import hazards
from companion.runtime.errors import UsageError
from companion.runtime.program_version import program_version
from tests.unit.companion.desk.evidence.results import OLD, campaign_flight, case, counts, junit, written


def texts(folder: Path) -> list[str]:
    return [(folder / f"evidence.{kind}").read_text("utf-8") for kind in ("html", "md")]


def test_without_an_artefact_every_hazard_has_no_evidence(tmp_path: Path) -> None:
    summary = evidence.run(tmp_path, [])
    assert summary["states"]["NO EVIDENCE"] == len(hazards())
    for text in texts(tmp_path):
        assert "NO EVIDENCE AT ALL" in text
        assert "NO EVIDENCE of touchdowns" in text
        assert "No evidence of real flights: no flight was counted." in text
        assert "every flight counted here is simulated" not in text
        assert "no line was removed before its digest was taken" in text
        assert text.count("NO EVIDENCE") > len(hazards())
        assert all(h.id in text for h in hazards())


def test_a_failure_is_shown_before_everything_else(tmp_path: Path) -> None:
    unsafe = campaign_flight(77, fault="killed", safe=False, program=program_version())
    path = written(tmp_path, "flights.jsonl", campaign_flight(1, program=program_version()), unsafe)
    summary = evidence.run(tmp_path / "out", [path])
    assert summary["states"]["UNSAFE"] > 0
    document = json.loads((tmp_path / "out" / "evidence.json").read_text("utf-8"))
    assert document["hazards"][0]["state"] == "UNSAFE"
    assert document["artefacts"][0]["runs"] == {program_version(): 2}
    page, markdown = texts(tmp_path / "out")
    assert "campaign 77: touched unsafe ground" in page
    assert "campaign 77: touched unsafe ground" in markdown
    states = re.findall(r"<span class=badge>([^<]*)</span>", page)
    assert states == sorted(
        states, key=["UNSAFE", "FAILED", "NO EVIDENCE", "evidence in part", "evidence"].index
    )
    assert states[0] == "UNSAFE"


def test_artefacts_of_another_or_an_unknown_version_are_named_and_not_counted(tmp_path: Path) -> None:
    stale = written(tmp_path, "stale.jsonl", campaign_flight(1, program=OLD))
    unknown = written(tmp_path, "unknown.xml", junit(case("test_a"), ""))
    assert evidence.run(tmp_path, [stale, unknown])["states"]["NO EVIDENCE"] == len(hazards())
    for text in texts(tmp_path):
        assert f"STALE: 1 runs of version {OLD}, not counted" in text
        assert "UNKNOWN VERSION: 1 runs, not counted" in text
        assert "Runs of another or unknown version, not counted: in A1, A2." in text


def test_digests_seeds_and_bounds_are_on_the_page(tmp_path: Path) -> None:
    all_safe = counts(program=program_version(), safe=10_000, refused=0, aborted=0, by_hazard={})
    path = written(tmp_path, "counts.json", all_safe)
    summary = evidence.run(tmp_path, [path])
    expected = "simulation: 10,000 touchdowns by the companion, 0 on unsafe ground; at most 0.030 % at 95 %."
    assert expected in summary["headline"]
    document = json.loads((tmp_path / "evidence.json").read_text("utf-8"))
    for text in texts(tmp_path):
        assert document["artefacts"][0]["sha256"] in text
        assert "0-9999" in text
        assert expected in text


def test_what_was_broken_off_is_a_landing_begun_and_what_was_refused_is_none(tmp_path: Path) -> None:
    some = counts(program=program_version(), safe=4_000, refused=900, aborted=5_000, by_hazard={})
    some |= {"failsafe": 100}
    expected = (
        "simulation: 9,000 landings begun, counted by other tools, 0 ended unsafe; at most 0.034 % at 95 %."
    )
    assert expected in evidence.run(tmp_path, [written(tmp_path, "counts.json", some)])["headline"]


def test_the_number_of_flights_that_were_reported_twice_is_on_the_page(tmp_path: Path) -> None:
    reported = [counts(program=program_version()), counts(program=program_version(), seeds=[[2_000, 12_000]])]
    paths = [written(tmp_path, f"{k}.json", each) for k, each in enumerate(reported)]
    assert evidence.run(tmp_path, paths)["repeated_runs"] == {"flights": 8_000}
    for text in texts(tmp_path):
        assert "8,000 flights were reported more than once and counted once." in text
        assert "2,000 flights were left out, not counted" in text


def test_ends_under_the_pilot_or_a_failsafe_are_on_the_page(tmp_path: Path) -> None:
    flights = [
        campaign_flight(k, landed_by=who, collision=hit, program=program_version())
        for k, (who, hit) in enumerate([("", None), ("pilot", {"e": 0.0}), ("failsafe", None)])
    ]
    evidence.run(tmp_path, [written(tmp_path, "flights.jsonl", *flights)])
    for text in texts(tmp_path):
        assert "1 flights not brought down by the pilot or a failsafe, 0 with a collision" in text
        assert (
            "2 flights brought down by the pilot or a failsafe, 1 on unsafe ground or into something" in text
        )


def test_a_number_of_failures_that_is_not_known_is_shown_as_the_least(tmp_path: Path) -> None:
    harness = {"name": "las", "inputs": 0, "ok": False, "failures": ["crash at start"]}
    made = {
        "format": "slz-fuzz",
        "version": 1,
        "program": program_version(),
        "seed": 1,
        "harnesses": [harness],
    }
    evidence.run(tmp_path, [written(tmp_path, "fuzz.json", made)])
    page, markdown = texts(tmp_path)
    assert "<td class=n>0</td><td class=n>≥ 1</td><td class=n>-</td>" in page
    assert "| fuzz las | simulation | 0 | ≥ 1 |" in markdown


def test_failures_that_no_hazard_names_are_above_the_hazards(tmp_path: Path) -> None:
    failed = junit(case("test_b", "<failure message='no'/>"), program_version())
    evidence.run(tmp_path, [written(tmp_path, "junit.xml", failed)])
    for text in texts(tmp_path):
        heading = text.index("Failures in runs that no hazard of the list names")
        assert heading < text.index("Hazards, barriers and evidence")


def test_an_older_page_stays_where_a_new_one_cannot_be_written(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    evidence.run(tmp_path, [])
    before = texts(tmp_path)

    def full(path: Path, *_: object, **__: object) -> int:
        path.touch()
        if path.name == "evidence.md":
            raise OSError(28, "No space left on device")
        return 0

    with monkeypatch.context() as patched:
        patched.setattr(Path, "write_text", full)
        with pytest.raises(UsageError, match="cannot be written: .*No space left"):
            evidence.run(tmp_path, [])
    assert texts(tmp_path) == before
    assert sorted(path.name for path in tmp_path.iterdir()) == [
        "evidence.html",
        "evidence.json",
        "evidence.md",
    ]


def test_the_name_of_an_artefact_that_is_no_unicode_is_written_in_another_way(tmp_path: Path) -> None:
    path = written(tmp_path, os.fsdecode(b"counts\xff.json"), counts())
    evidence.run(tmp_path, [path])
    for text in texts(tmp_path):
        assert "counts\\udcff.json" in text


def test_counts_that_may_be_a_copy_of_others_are_asked_for_on_the_page(tmp_path: Path) -> None:
    reported = [counts(program=program_version(), tool=tool) for tool in ("search", "mine")]
    evidence.run(tmp_path, [written(tmp_path, f"{k}.json", each) for k, each in enumerate(reported)])
    for text in texts(tmp_path):
        assert "COUNTED TWICE? Counts of search (A1) and mine (A2) are equal" in text


@pytest.mark.parametrize(
    ("environments", "said"),
    [
        (["simulation"], ["No evidence of real flights: every flight counted here is simulated."]),
        (
            ["recording", "simulation"],
            ["No evidence of real flights: those counted here are of recording, simulation."],
        ),
        (["simulation", "flight"], []),
    ],
)
def test_what_was_flown_is_said_also_without_a_touchdown(
    tmp_path: Path, environments: list[str], said: list[str]
) -> None:
    none_landed = counts(program=program_version(), safe=0, refused=10_000, aborted=0, by_hazard={})
    paths = [written(tmp_path, each, none_landed | {"environment": each}) for each in environments]
    headline = evidence.run(tmp_path / "out", paths)["headline"]
    assert [line for line in headline if "real flights" in line] == said


def test_the_links_of_a_hazard_are_as_many_without_artefacts_as_with_some(tmp_path: Path) -> None:
    path = written(tmp_path, "counts.json", counts(program=program_version()))
    asked = []
    for artefacts in ([], [path]):
        evidence.run(tmp_path, artefacts)
        found = [
            re.findall(r"(\d+) of (\d+)((?: \+ \d counts)?)(?: \||</td>)", text) for text in texts(tmp_path)
        ]
        assert sorted(found[0]) == sorted(found[1])
        assert len(found[0]) == len(hazards())
        asked.append(sorted(int(number) for _, number, _ in found[0]))
    assert asked[0] == asked[1]
    assert any(counts_of for *_, counts_of in found[0])


def test_the_page_loads_nothing_and_holds_no_markup_of_an_artefact(tmp_path: Path) -> None:
    bad = campaign_flight(1, not_as_stated=["<script>alert(1)</script>"], program=program_version())
    evidence.run(tmp_path, [written(tmp_path, "flights.jsonl", bad)])
    page = texts(tmp_path)[0]
    assert re.findall(r"<(?:script|link|img|iframe)|(?:src|url)\s*[=(]|https?:", page) == []
    assert "&lt;script&gt;" in page


def test_the_markdown_holds_no_markup_of_an_artefact_and_keeps_its_rows(tmp_path: Path) -> None:
    bad = "<img src=x onerror=alert(1)>\n| a |"
    failed = case("test_a[&lt;b&gt;&#10;|]", "<failure message='&lt;img src=x onerror=alert(1)&gt;'/>")
    paths = [
        written(tmp_path, "a|`<i>.json", counts(program=program_version(), tool=bad)),
        written(tmp_path, "junit.xml", junit(failed, program_version())),
        written(tmp_path, "old.json", counts(program=bad)),
        written(tmp_path, "log", campaign_flight(1, not_as_stated=[bad], program=program_version())),
    ]
    evidence.run(tmp_path / "out", paths)
    markdown = texts(tmp_path / "out")[1]
    assert re.findall(r"<[a-z].*", markdown) == []
    assert "&lt;img src=x onerror=alert(1)&gt;" in markdown
    lines = markdown.split("\n")
    for k, line in enumerate(lines):
        if line.startswith("|"):
            head = next(lines[j + 1] for j in range(k, -1, -1) if not lines[j - 1].startswith("|"))
            assert len(re.findall(r"(?<!\\)\|", line)) == head.count("|")


def test_an_artefact_named_twice_is_refused(tmp_path: Path) -> None:
    path = written(tmp_path, "counts.json", counts())
    with pytest.raises(UsageError, match="named twice"):
        evidence.run(tmp_path, [path, path.parent / "." / path.name])


def test_the_command_sums_up_in_json_or_refuses_in_one_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(sys, "argv", ["slz", "evidence", "--out", str(tmp_path), "--json"])
    with pytest.raises(SystemExit) as left:
        program.main()
    assert left.value.code == 0
    assert json.loads(capsys.readouterr().out)["program"] == program_version()
    monkeypatch.setattr(sys, "argv", ["slz", "evidence", "--out", str(tmp_path), "--artefact", "none.json"])
    with pytest.raises(SystemExit) as left:
        program.main()
    assert left.value.code == 2
    assert capsys.readouterr().err == "slz: --artefact none.json: No such file or directory\n"


def test_shares_are_rounded_up() -> None:
    assert [share(v) for v in (None, 1.0, 0.95, 0.0301, 0.00029953, 0.0002, 0.00100001, 3e-7)] == [
        "-", "100 %", "95 %", "3.1 %", "0.030 %", "0.020 %", "0.11 %", "0.000030 %",
    ]  # fmt: skip
