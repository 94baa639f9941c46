"""Artefact of a run: a file with results, recognised by its content."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from pathlib import Path

from companion.desk.evidence import flight_results
from companion.desk.evidence.artefact_fields import ArtefactError, Fields, NoJsonError
from companion.desk.evidence.evidence_runs import UNKNOWN_VERSION, Runs
from companion.desk.evidence.fuzz_and_soak import FUZZ, FUZZ_FORMAT, SOAK, is_soak, read_fuzz, read_soak
from companion.desk.evidence.junit_report import read_junit
from companion.desk.evidence.landing_counts import COUNTS, COUNTS_FORMAT, read_counts

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
