"""`slz reproduce`: the sources' scenes and figures."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated

import typer

from companion.cli.console import progress, set_up_logging, stdout_console
from companion.cli.options import Json, Verbose
from companion.runtime import extras


def reproduce(
    out: Annotated[Path, typer.Option(help="Folder for the page, pictures and flown surveys.")],
    only: Annotated[
        str,
        typer.Option(
            help="Only scenes whose name holds this: stadium, road, mountains, dense, hill, lake, surface,"
            " odometry, flash, radar.",
            show_default="all",
        ),
    ] = "",
    as_json: Json = False,
    verbose: Verbose = False,
) -> None:
    """Run the sources' scenes and write one page with their figures and ours."""
    for extra in ("plots", "survey"):
        extras.require(extra, "slz reproduce")
    set_up_logging(verbose)
    from companion.desk import reproduce as reproduction

    with progress(as_json) as step:
        summary = reproduction.run(out, step, only)
    if as_json:
        print(json.dumps(summary))
    else:
        stdout_console().print(f"see {summary['files'][1]}")
