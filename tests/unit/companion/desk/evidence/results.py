"""Results of tests, flights and counts, as the programs that make them write them."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from companion.desk.evidence.artefact_file import Artefact, read_artefact
from companion.desk.evidence.hazard_list import Hazard, Severity

NOW, OLD = "0.2.0+aaaaaaaaaaaa", "0.1.0+bbbbbbbbbbbb"


def hazard(number: int = 1, **links: tuple[str, ...]) -> Hazard:
    texts = ("a hazard", "a cause", "an effect")
    return Hazard(f"H{number:02}", *texts, Severity.MAJOR, "a reaction", (), **links)


def campaign_flight(number: int, **more: Any) -> dict[str, Any]:
    return {
        "number": number,
        "fault": "lidar_stop",
        "state": "final",
        "began_s": 10.0,
        "safe": True,
        "touchdown": {"t_ns": 1},
        "collision": None,
        "landed_by": "",
        "commands_while_pilot_flies": 0,
        "not_as_stated": [],
        "program": NOW,
    } | more


def landing(number: int, **more: Any) -> dict[str, Any]:
    return {
        "number": number,
        "taken_over_in": None,
        "hazards": "car@8.00",
        "hazard_arrived": True,
        "landed": True,
        "safe": True,
        "error_m": 0.2,
        "collision": None,
        "crossing": None,
        "commands_while_pilot_flies": 0,
        "failure": "",
        "kind": "hazard",
        "program": NOW,
    } | more


def counts(**more: Any) -> dict[str, Any]:
    return {
        "format": "slz-counts",
        "version": 1,
        "program": NOW,
        "tool": "search",
        "environment": "simulation",
        "sampling": "independent",
        "seeds": [[0, 10_000]],
        "flights": 10_000,
        "safe": 9_990,
        "refused": 6,
        "aborted": 4,
        "unsafe": 0,
        "by_hazard": {"box": {"flights": 100, "safe": 92, "refused": 5, "aborted": 3, "unsafe": 0}},
    } | more


def junit(cases: str, program: str = NOW) -> str:
    given = f"<properties><property name='slz_program' value='{program}'/></properties>" if program else ""
    return f"<testsuites><testsuite name='pytest'>{given}{cases}</testsuite></testsuites>"


def case(name: str, inside: str = "") -> str:
    return f"<testcase classname='tests.unit.test_a' name='{name}'>{inside}</testcase>"


def written(folder: Path, name: str, *documents: Any) -> Path:
    """Write documents to a file, texts unchanged and all others as a line of JSON each."""
    path = folder / name
    lines = [each if isinstance(each, str) else json.dumps(each) for each in documents]
    path.write_text("\n".join(lines) + "\n", "utf-8")
    return path


def artefact(folder: Path, name: str, *documents: Any) -> Artefact:
    return read_artefact(written(folder, name, *documents))
