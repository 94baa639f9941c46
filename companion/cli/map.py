"""`slz map`: landing zones in stored clouds."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Annotated

import typer

import params
from companion.cli.console import progress, set_up_logging, stdout_console, zone_table
from companion.cli.options import Json, Profile, Settings, Verbose
from companion.runtime import extras, kernel_compilation

UNBLOCKED = {"ways not blocked °": lambda zone: str(zone["corridors"]["unblocked_deg"])}


def map_(
    files: Annotated[list[Path], typer.Argument(help="LAS, LAZ, COPC, PCD, PLY or text: x y z.")],
    out: Annotated[Path, typer.Option(help="Folder for the results.")],
    cell_m: Annotated[float | None, typer.Option(help="Side of a cell, m (0.5).")] = None,
    min_square_m: Annotated[float | None, typer.Option(help="Side of the safe square, m (3).")] = None,
    max_slope_deg: Annotated[float | None, typer.Option(help="Steepest safe slope, degrees (10).")] = None,
    crs: Annotated[str | None, typer.Option(help="CRS of files that name none, such as EPSG:2992.")] = None,
    vertical_unit: Annotated[
        str | None,
        typer.Option(metavar="m|ft|us-ft", help="Unit of the heights, where files do not say or contradict."),
    ] = None,
    classified: Annotated[
        bool, typer.Option("--classified", help="Write the points too, class 64 safe, 65 unsafe, 66 unknown.")
    ] = False,
    corridors: Annotated[
        bool,
        typer.Option(
            "--corridors",
            help="Also judge the ways in and out of each landing point (approach_slope_deg, corridor_m):"
            " blocked, or not seen.",
        ),
    ] = False,
    tile_m: Annotated[
        float | None, typer.Option(help="Side of a tile, m (1024 cells); it changes no result.")
    ] = None,
    workers: Annotated[
        int | None, typer.Option(help="Worker processes on this machine; none: all in this one.")
    ] = None,
    scheduler: Annotated[
        str | None, typer.Option(metavar="tcp://HOST:PORT", help="Use the workers of a Dask scheduler.")
    ] = None,
    profile: Profile = "quadcopter",
    setting: Settings = [],  # noqa: B006
    as_json: Json = False,
    verbose: Verbose = False,
) -> None:
    """Find the landing zones in stored clouds."""
    extras.require("survey", "slz map")
    from companion.desk import survey
    from companion.desk.clouds.cloud import open_clouds

    given = {"cell_m": cell_m, "min_square_m": min_square_m, "safe_slope_deg": max_slope_deg}
    if profile == "quadcopter" and cell_m is None:
        given["cell_m"] = 0.5
    own = [f"{name}={value}" for name, value in given.items() if value is not None]
    parameters = params.load(profile, [*own, *setting])
    open_clouds(files, crs, vertical_unit)  # headers are read before any kernel is compiled or loaded
    with survey.engine(scheduler, workers) as engine:
        plan = survey.MapOptions(crs, classified, tile_m, engine, vertical_unit, corridors)
        plan.check(out, parameters)
        set_up_logging(verbose, kernel_compilation.of_survey(parameters.mode))
        with progress(as_json) as step:
            summary = survey.run(files, out, parameters, step, plan)
    if as_json:
        print(json.dumps(summary))
    else:
        title = f"{len(summary['zones'])} zones, maps in {out}"
        stdout_console().print(zone_table(summary["zones"], title, UNBLOCKED if corridors else {}))
        if summary["no_zone"]:
            stdout_console().print(f"no zone: {summary['no_zone']}")
    for skipped in summary["skipped"]:
        print(f"slz: left out: {skipped['reason']}", file=sys.stderr)
    if summary["skipped"]:
        sys.exit(2)
