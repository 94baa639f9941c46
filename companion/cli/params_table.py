"""`slz params`: the table of parameters, and the autopilot's parameter files."""

from __future__ import annotations

import json
from typing import Annotated

import typer
from rich.table import Table

import params
from companion.cli.console import stdout_console
from companion.cli.options import Json, Profile, Settings


def params_(
    profile: Profile = "quadcopter",
    setting: Settings = [],  # noqa: B006
    autopilot: Annotated[
        str | None,
        typer.Option(
            metavar="NAME",
            help="Print a parameter file of the autopilot instead: arducopter, arducopter_odometry, px4,"
            " px4_odometry or px4_sih.",
        ),
    ] = None,
    as_json: Json = False,
) -> None:
    """List every parameter with its value, range and meaning."""
    if autopilot is not None:
        file, text = params.autopilot_file(autopilot)
        print(json.dumps({"file": file, "text": text}) if as_json else text, end="\n" if as_json else "")
        return
    values = params.load(profile, setting).model_dump()
    if as_json:
        table = {
            row.name: {
                "value": values[row.name],
                "mavlink": row.mavlink,
                "unit": row.unit,
                "allowed": params.allowed(row),
                "default": row.default,
                "source": row.source,
                "description": row.sentence,
                "live": row.live,
            }
            for row in params.rows()
        }
        print(json.dumps(table))
        return
    shown = Table("name", "MAVLink", "value", "allowed", "source", "meaning")
    for row in params.rows():
        shown.add_row(
            row.name, row.mavlink, str(values[row.name]), params.allowed(row), row.source, row.sentence
        )
    stdout_console().print(shown)
