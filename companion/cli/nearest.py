"""`slz nearest`: surveyed zones nearest to a position."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated

import typer
from rich.table import Table

from companion.cli.console import stdout_console
from companion.cli.options import Json
from companion.runtime import extras


def nearest(
    lat: Annotated[float, typer.Argument(help="Latitude, degrees north.")],
    lon: Annotated[float, typer.Argument(help="Longitude, degrees east.")],
    folder: Annotated[Path, typer.Option("--survey", help="Folder that slz map wrote.")] = Path(),
    radius_m: Annotated[
        float | None,
        typer.Option(
            help="Only zones that hold it or whose landing points lie this near, m.",
            show_default="any distance",
        ),
    ] = None,
    most: Annotated[int, typer.Option(help="So many at most.")] = 10,
    as_json: Json = False,
) -> None:
    """Find the surveyed landing zones nearest to a position."""
    extras.require("survey", "slz nearest")
    from companion.desk.survey import nearest_zones as question

    answer = question.nearest(folder, lat, lon, radius_m, most)
    if as_json:
        print(json.dumps(answer))
        return
    table = Table(
        "zone", "distance m", "bearing °", "area m²", "certainty", "slope °", "latitude", "longitude"
    )
    for zone in answer["zones"]:
        table.add_row(
            str(zone["id"]),
            f"{zone['distance_m']:.0f}",
            f"{zone['bearing_deg']:.0f}",
            f"{zone['area_m2']:.0f}",
            f"{zone['certainty']:.2f}",
            "" if zone["slope_deg"] is None else f"{zone['slope_deg']:.1f}",
            f"{zone['lat']:.7f}",
            f"{zone['lon']:.7f}",
        )
    stdout_console().print(table if answer["zones"] else f"no zone: {answer['no_zone']}")
