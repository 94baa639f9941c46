"""Artefact of a run: a file with results, recognised by its content."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from pathlib import Path
from xml.etree import ElementTree

from companion.desk.evidence import flight_results
from companion.desk.evidence.artefact_fields import ArtefactError, Fields, NoJsonError
from companion.desk.evidence.evidence_ledger import UNKNOWN_VERSION, Runs, one
from companion.desk.evidence.flight_results import FUZZ, FUZZ_FORMAT, SOAK, is_soak, read_fuzz, read_soak
from companion.desk.evidence.landing_counts import COUNTS, COUNTS_FORMAT, read_counts

PROGRAM_PROPERTY = "slz_program"
HEADERS = {"failure": "failures", "error": "errors", "skipped": "skipped"}

MOST_BYTES = 2_000_000_000


@dataclass(frozen=True, slots=True)
class Artefact:
    """A file, its digest, kind, runs, and notes about it."""

    path: Path
    sha256: str
    kind: str
    runs: list[Runs]
    notes: list[str]

    def programs(self) -> list[str]:
        """Return the versions of the program that its runs name; "" is an unknown one."""
        return sorted({runs.program for runs in self.runs})

    def count(self, program: str) -> int:
        """Return the number of runs by a version of the program: tests, flights, inputs, soaks."""
        return sum(runs.runs for runs in self.runs if runs.program == program and runs.is_whole())


def read_artefact(path: Path) -> Artefact:
    """Read a file and recognise it.

    Raises
    ------
    ArtefactError
        It cannot be read, is damaged, empty, or no artefact that is known.
    """
    try:
        if path.stat().st_size > MOST_BYTES:
            raise ArtefactError(f"--artefact {path}: larger than {MOST_BYTES / 1e9:.0f} GB")
        content = path.read_bytes()
        text = content.decode("utf-8")
    except OSError as error:
        raise ArtefactError(f"--artefact {path}: {error.strerror}") from None
    except UnicodeDecodeError:
        raise ArtefactError(f"--artefact {path}: no text in UTF-8") from None
    kind, runs, notes = _recognised(str(path), text)
    if not runs:
        raise ArtefactError(f"--artefact {path}: it holds no run")
    if UNKNOWN_VERSION in {run.program for run in runs}:
        notes.append("it does not record the version of the program: made before versions were recorded")
    return Artefact(path, hashlib.sha256(content).hexdigest(), kind, runs, notes)


def _recognised(name: str, text: str) -> tuple[str, list[Runs], list[str]]:
    if text.lstrip().startswith("<"):
        return "test", read_junit(name, text), []
    first = next((line for line in text.splitlines() if line.strip()), "")
    if not first:
        raise ArtefactError(f"--artefact {name}: it is empty")
    try:
        line = Fields.parse(name, first)
    except NoJsonError:
        line = Fields(name, {})
    if kind := flight_results.kind_of_flight(line):
        return kind, *flight_results.read_flights(name, text, kind)
    document = Fields.parse(name, text)
    match document.values.get("format"):
        case "slz-counts":
            return COUNTS, read_counts(document), []
        case "slz-fuzz":
            return FUZZ, read_fuzz(document), []
    if is_soak(document):
        return SOAK, read_soak(document), []
    raise ArtefactError(
        f"--artefact {name}: no result of tests, campaign, landings, fuzz or soak, and no {COUNTS_FORMAT} or "
        f"{FUZZ_FORMAT} (docs/evidence.md)"
    )


def read_junit(name: str, text: str) -> list[Runs]:
    """Return a run for each test; its variant is the node ID with the case: `tests/a/test_b.py::test_c[1]`.

    Its version is that of the suite in which it is.

    Raises
    ------
    ArtefactError
        It is no such report, a test is in no suite or has no name, or the numbers of a header are not those
        of the tests below it.
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
        runs += [_run(case, program) for case in suite.findall("testcase")]
    if len(runs) < sum(1 for _ in root.iter("testcase")):
        raise ArtefactError(
            f"--artefact {name}: a <testcase> is not directly in a <testsuite>: put it into its own"
        )
    if any(run.variant.endswith("::") for run in runs):
        raise ArtefactError(
            f"--artefact {name}: a <testcase> without a name: the tests were interrupted: run them again"
        )
    for each in root.iter():
        if each.tag in ("testsuites", "testsuite"):
            _check_header(name, each)
    return runs


def _check_header(name: str, suite: ElementTree.Element) -> None:
    """Compare the numbers of a header with the tests below it, as pytest counts them.

    A test that fails and has an error in its teardown is two test cases, and one test or two by the version
    of pytest; so is one that passes and has such an error, in one test case. A subtest that passes is counted
    and not written down: a report with such ones is refused.
    """
    cases = list(suite.iter("testcase"))
    outcomes = [[child.tag for child in each if child.tag in HEADERS] for each in cases]
    fewest = len({(each.get("classname"), each.get("name")) for each in cases})
    most = sum(2 if each == ["error"] else max(1, len(each)) for each in outcomes)
    found = {HEADERS[tag]: sum(each.count(tag) for each in outcomes) for tag in HEADERS}
    for header, (low, high) in {"tests": (fewest, most), **{k: (n, n) for k, n in found.items()}}.items():
        said = suite.get(header, str(low))
        if not (said.isdecimal() and len(said) < 20 and low <= int(said) <= high):
            raise ArtefactError(
                f"--artefact {name}: <{suite.tag}> has {header}={said!r:.20}, and below it are "
                f"{low if low == high else f'{low} to {high}'}: run the tests again, without subtests"
            )


def _run(case: ElementTree.Element, program: str) -> Runs:
    node = f"{case.get('classname', '').replace('.', '/')}.py::{case.get('name', '')}"
    wrong = next((child for child in case if child.tag in ("failure", "error")), None)
    skipped = wrong is None and case.find("skipped") is not None
    what = "" if wrong is None else " ".join((wrong.get("message") or wrong.tag).split())[:200]
    return Runs("test", node, one(0), program, 1, int(wrong is not None), 0, int(skipped), False, what=what)
