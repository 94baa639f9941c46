"""Test results in JUnit's XML, as `pytest --junitxml` writes them."""

from __future__ import annotations

from xml.etree import ElementTree

from companion.desk.evidence.artefact_fields import ArtefactError
from companion.desk.evidence.evidence_runs import UNKNOWN_VERSION, Runs, one

PROGRAM_PROPERTY = "slz_program"


def read_junit(name: str, text: str) -> list[Runs]:
    """Return a run for each test; its variant is the node ID with the case: `tests/a/test_b.py::test_c[1]`.

    Raises
    ------
    ArtefactError
        It is no such report.
    """
    if "<!DOCTYPE" in text or "<!ENTITY" in text:
        raise ArtefactError(f"--artefact {name}: an XML with definitions of its own is not read")
    try:
        root = ElementTree.fromstring(text)
    except ElementTree.ParseError as error:
        raise ArtefactError(f"--artefact {name}: no XML: {error}") from None
    if root.tag not in ("testsuites", "testsuite"):
        raise ArtefactError(f"--artefact {name}: <{root.tag}> is no JUnit report")
    runs = []
    for suite in root.iter("testsuite"):
        found = suite.find(f"properties/property[@name='{PROGRAM_PROPERTY}']")
        program = UNKNOWN_VERSION if found is None else found.get("value", UNKNOWN_VERSION)
        runs += [_run(case, program) for case in suite.iter("testcase")]
    return runs


def _run(case: ElementTree.Element, program: str) -> Runs:
    node = f"{case.get('classname', '').replace('.', '/')}.py::{case.get('name', '')}"
    wrong = next((child for child in case if child.tag in ("failure", "error")), None)
    skipped = wrong is None and case.find("skipped") is not None
    what = "" if wrong is None else " ".join((wrong.get("message") or wrong.tag).split())[:200]
    return Runs("test", node, one(0), program, 1, int(wrong is not None), 0, int(skipped), False, what=what)
