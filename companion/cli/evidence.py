"""`slz evidence`: hazards, barriers and what runs say about them."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated

import typer

from companion.cli.console import stdout_console
from companion.cli.options import Json


def evidence(
    out: Annotated[Path, typer.Option(help="Folder for evidence.html, evidence.md and evidence.json.")],
    artefact: Annotated[
        list[Path] | None,
        typer.Option(
            help="Result of tests, campaign, landings, fuzz, soak or counts (docs/evidence.md); repeat."
        ),
    ] = None,
    as_json: Json = False,
) -> None:
    """Build a safety case from the artefacts of runs: hazards, barriers, tests, counts with their bounds."""
    from companion.desk import evidence as safety_case

    summary = safety_case.run(out, artefact or [])
    if as_json:
        print(json.dumps(summary))
        return
    for line in (*summary["headline"], f"see {summary['files'][0]}"):
        stdout_console().print(line, highlight=False)
