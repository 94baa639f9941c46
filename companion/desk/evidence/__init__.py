"""Safety case from the artefacts of runs (`slz evidence`)."""

from __future__ import annotations

import json
import tempfile
from collections import Counter
from collections.abc import Mapping, Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from companion.desk.evidence.artefact_file import read_artefact
from companion.desk.evidence.case_report import case_document, case_markdown, case_page
from companion.desk.evidence.hazard_list import hazards
from companion.desk.evidence.safety_case import make_case
from companion.runtime import output_folder
from companion.runtime.errors import UsageError
from companion.runtime.program_version import program_version

__all__ = ["run"]


def run(out: Path, artefacts: Sequence[Path]) -> dict[str, Any]:
    """Read artefacts, write evidence.html, evidence.md and evidence.json, and return a summary.

    Raises
    ------
    UsageError
        An artefact cannot be read or is named twice, or the folder cannot be written.
    """
    twice = [path for path, count in Counter(path.resolve() for path in artefacts).items() if count > 1]
    if twice:
        raise UsageError(f"--artefact {twice[0]}: named twice")
    read = [read_artefact(path) for path in artefacts]
    case = make_case(hazards(), read, program_version())
    made = datetime.now(UTC).strftime("%Y-%m-%d %H:%M UTC")
    document = case_document(case, made)
    texts = {
        "evidence.html": case_page(case, made),
        "evidence.md": case_markdown(case, made),
        "evidence.json": json.dumps(document, indent=1) + "\n",
    }
    _write(out, texts)
    kept = ("program", "states", "headline", "unknown_counts", "repeated_runs", "left_out_runs")
    return {name: document[name] for name in kept} | {"files": [str(out / name) for name in texts]}


def _write(out: Path, texts: Mapping[str, str]) -> None:
    """Write files to a folder; an older one stays until all new ones are whole.

    Raises
    ------
    UsageError
        The folder or a file cannot be written.
    """
    output_folder.prepare(out)
    try:
        with tempfile.TemporaryDirectory(dir=out, prefix=".unfinished-") as unfinished:
            for name, text in texts.items():
                # The name of an artefact's file may be no Unicode.
                Path(unfinished, name).write_text(text, "utf-8", errors="backslashreplace")
            for name in texts:
                Path(unfinished, name).replace(out / name)
    except OSError as error:
        raise UsageError(f"--out {out}: cannot be written: {error}") from None
