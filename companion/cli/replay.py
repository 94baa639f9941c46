"""`slz replay`: a recorded flight, processed again."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Annotated

import typer

from companion.cli.console import page_endpoint, progress, set_up_logging, stdout_console, zone_table
from companion.cli.options import Background, Dashboard, DashboardToken, Json, Settings, System, Verbose
from companion.runtime import extras
from companion.runtime.interrupt import Interrupts


def replay(
    context: typer.Context,
    file: Annotated[
        Path, typer.Argument(help="Recording of slz run --record, ROS 2 bag, or FLIGHT.tlog with --points.")
    ],
    out: Annotated[Path | None, typer.Option(help="Folder for the maps at the end.")] = None,
    points: Annotated[
        str | None,
        typer.Option(
            help="Topic of the points of a bag; beside a .tlog FILE.pcap, CLOUD.laz or a folder of PCD."
        ),
    ] = None,
    pose: Annotated[
        list[str], typer.Option(help="Topic of the poses of a bag; or twice: NavSatFix and Imu.")
    ] = [],  # noqa: B006
    lidar: Annotated[
        str | None,
        typer.Option(help="livox, velodyne or ouster?meta=FILE.", show_default="told by the packets"),
    ] = None,
    origin: Annotated[
        str | None, typer.Option(help="LAT,LON,ALT where the local frame of a bag's poses begins.")
    ] = None,
    vertical_unit: Annotated[
        str | None,
        typer.Option(metavar="m|ft|us-ft", help="Unit of the heights of CLOUD.laz, whatever it says."),
    ] = None,
    profile: Annotated[str, typer.Option(help="Profile for files of other programs.")] = "quadcopter",
    speed: Annotated[float, typer.Option(min=0, help="Seconds of flight a second; 0: all it can.")] = 0.0,
    start: Annotated[float, typer.Option("--from", min=0, help="Map from so many seconds on.")] = 0.0,
    until: Annotated[
        float, typer.Option(min=0, help="End after so many seconds.", show_default="the end")
    ] = 1e9,
    system: System = None,
    dashboard: Dashboard = None,
    dashboard_token: DashboardToken = None,
    background: Background = None,
    setting: Settings = [],  # noqa: B006
    as_json: Json = False,
    verbose: Verbose = False,
) -> None:
    """Run a recorded flight again; exit 1 if its zones are not those of the flight."""
    extras.require("record", "slz replay")
    if out is not None:
        extras.require("plots", "--out")
    set_up_logging(verbose)
    from companion.desk.replay import replay_run
    from companion.desk.replay.recording_type import RecordingOptions

    options = RecordingOptions(points, tuple(pose), lidar, origin, profile, system, vertical_unit)
    with page_endpoint(dashboard, dashboard_token, background) as front:
        if front is not None:
            from companion.desk.replay.replay_page import show

            interrupts: Interrupts = context.obj
            show(file, setting, front, options, speed, interrupts.handled_by)
            return

    with progress(as_json) as step:
        summary = replay_run.run(
            file, setting, out, speed, (start, until), lambda _at, text: step(text, 0.0), options
        )
    for line in (*summary["warnings"], *([f"no zone: {why}"] if (why := summary["why_no_zones"]) else [])):
        print(f"slz: {file}: {line}", file=sys.stderr)
    if as_json:
        print(json.dumps(summary))
    else:
        title = f"{summary['windows']} windows"
        if "source" not in summary:
            title += f", {summary['identical']} as in flight"
        stdout_console().print(zone_table(summary["zones"], title))
        if summary["cut"]:
            print(f"slz: {file}: it is not whole: {summary['cut']}", file=sys.stderr)
        if summary["lost_messages"]:
            print(f"slz: {file}: {summary['lost_messages']} messages were lost in flight", file=sys.stderr)
    if summary["different"] and not setting and start == 0:
        sys.exit(1)
