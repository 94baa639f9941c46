"""`slz calibrate`: the LiDAR's boresight and time offset from a recording."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.table import Table

from companion.cli.console import set_up_logging, stdout_console
from companion.cli.options import Json, Settings, Verbose
from companion.runtime import extras


def calibrate(
    file: Annotated[Path, typer.Argument(help="Recording of slz run --record.")],
    setting: Settings = [],  # noqa: B006
    as_json: Json = False,
    verbose: Verbose = False,
) -> None:
    """Find the LiDAR's boresight and time offset from a recorded flight over ground seen several times."""
    extras.require("record", "slz calibrate")
    set_up_logging(verbose, {})
    from companion.desk.calibrate import calibration

    summary = calibration.run(file, setting)
    if as_json:
        print(json.dumps(summary))
    else:
        stdout_console().print(_calibration_table(summary))


def _calibration_table(found: dict[str, Any]) -> Table:
    title = f"returns agree to {found['after_m'] * 100:.1f} cm, before {found['before_m'] * 100:.1f} cm"
    table = Table("", "correction", "standard error", title=title)
    for name, value in found["correction"].items():
        error = found["standard_error"][name]
        table.add_row(name, *(("not shown", "") if value is None else (f"{value:+.3f}", f"{error:.3f}")))
    for name, value in found["parameters"].items():
        table.add_row(f"--set {name}={value:g}", "", "")
    return table
