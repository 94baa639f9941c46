"""`slz run`: the companion on the vehicle."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated

import typer

from companion.cli.console import compile_at_first, page_endpoint, set_up_logging
from companion.cli.options import (
    LIDAR,
    Background,
    Dashboard,
    DashboardToken,
    Json,
    Key,
    Prior,
    Profile,
    Ros2,
    Ros2Odometry,
    Settings,
    State,
    System,
    Verbose,
)
from companion.runtime import extras, kernel_compilation
from companion.runtime.errors import UsageError


def run(
    mavlink: Annotated[str, typer.Option(help="udpin:HOST:PORT, tcp:HOST:PORT or /dev/ttyX,BAUD.")],
    lidar: Annotated[str, typer.Option(help=LIDAR)],
    land: Annotated[
        str,
        typer.Option(
            help="ask: wait for the operator. auto: land without further word. assist: as ask, and offer the"
            " autopilot's own landings a safe target (SLZ_ASSIST)."
        ),
    ] = "ask",
    profile: Profile = "quadcopter",
    setting: Settings = [],  # noqa: B006
    mavlink_key: Key = None,
    state_dir: State = None,
    radar: Annotated[
        str | None, typer.Option(help="A radar beside the LiDAR: radar:HOST:PORT (docs/instruments.md).")
    ] = None,
    record: Annotated[Path | None, typer.Option(help="Record the flight: FILE.mcap.")] = None,
    out: Annotated[Path | None, typer.Option(help="Folder for maps at the end.")] = None,
    dashboard: Dashboard = None,
    dashboard_token: DashboardToken = None,
    background: Background = None,
    foxglove: Annotated[
        int | None,
        typer.Option(min=0, max=65535, metavar="PORT", help="Serve Foxglove's live view on 127.0.0.1:PORT."),
    ] = None,
    ros2: Ros2 = None,
    ros2_odometry: Ros2Odometry = None,
    prior: Prior = None,
    system: System = None,
    as_json: Json = False,
    verbose: Verbose = False,
) -> None:
    """Run on the vehicle: read the autopilot and the LiDAR, map, choose and land."""
    for option, extra, given in (
        ("--out", "plots", out),
        ("--prior", "survey", prior),
        ("--dashboard", "page", dashboard),
        ("--foxglove", "record", foxglove),
        ("--ros2", "ros", ros2),
        ("--ros2-odometry", "ros", ros2_odometry),
    ):
        if given is not None:
            extras.require(extra, option)
    set_up_logging(verbose, {})
    from companion.flight.services import settings
    from companion.runtime.state_directory import StateDir, default_state_dir

    if land not in ("ask", "auto", "assist"):
        raise UsageError(f"--land {land!r}: use ask, auto or assist")
    state = StateDir(state_dir or default_state_dir())
    parameters = settings.load(profile, setting, state)
    if land == "assist" and parameters.assist == "off":
        parameters = settings.load(profile, [*setting, "assist=offer"], state)
    compile_at_first(kernel_compilation.of_flight(parameters.mode))
    from companion.cli import vehicle_run

    with page_endpoint(dashboard, dashboard_token, background) as front:
        summary = vehicle_run.run(
            mavlink,
            lidar,
            land == "auto",
            parameters,
            out,
            state,
            key_file=mavlink_key,
            record=record,
            radar_url=radar,
            front=front,
            foxglove_port=foxglove,
            prior=prior,
            system=system,
            ros2=ros2,
            ros2_odometry=ros2_odometry,
        )
    if as_json:
        print(json.dumps(summary))
