"""`slz demo`: the simulator and the companion together."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Annotated

import typer

import params
from companion.cli.console import compile_at_first, err, page_endpoint, set_up_logging, stdout_console
from companion.cli.options import Background, DashboardToken, Json, Prior, Profile, Settings, Verbose
from companion.desk.demo.demo_options import (
    INTRUDERS,
    SCENES,
    SENSORS,
    DemoOptions,
    check,
    sensor_named,
    usual_sensor,
)
from companion.runtime import extras, kernel_compilation

DEMO_PAGE = "127.0.0.1:0"  # any free port


def demo(
    context: typer.Context,
    scene: Annotated[
        str,
        typer.Option(help=f"{', '.join(SCENES)} (docs/scenario.md)."),
    ] = "stadium",
    sensor: Annotated[
        str | None,
        typer.Option(
            help=f"{', '.join(sensor.name for sensor in SENSORS)}.",
            show_default="lidar, a Mid-360; above 40 m opal",
        ),
    ] = None,
    seed: Annotated[int, typer.Option(min=0, help="Seed of scene, wind and noise.")] = 1,
    speedup: Annotated[
        float, typer.Option(help="Simulated seconds per second; 0 is as fast as possible.")
    ] = 0.0,
    headless: Annotated[bool, typer.Option("--headless", help="No live display.")] = False,
    out: Annotated[Path, typer.Option(help="Folder for maps and figures.")] = Path("out/demo"),
    intruder: Annotated[
        str,
        typer.Option(
            help="car@15: a car drives onto the landing point below 15 m; likewise "
            f"{', '.join(INTRUDERS[1:])}; several by commas."
        ),
    ] = "none",
    point_rate: Annotated[float, typer.Option(help="LiDAR points per second.")] = 200_000.0,
    limit_s: Annotated[float, typer.Option(help="Give up after so many simulated seconds.")] = 900.0,
    wind: Annotated[float, typer.Option(help="Mean wind 10 m over the ground, m/s.")] = 3.0,
    wind_from: Annotated[
        float | None,
        typer.Option(help="Direction from which it blows, degrees.", show_default="drawn by the seed"),
    ] = None,
    dashboard: Annotated[
        str | None,
        typer.Option(
            metavar="HOST:PORT",
            help="Serve the pilot's page (docs/page.md).",
            show_default="127.0.0.1, any free port; none with --headless",
        ),
    ] = None,
    dashboard_token: DashboardToken = None,
    background: Background = None,
    profile: Profile = "quadcopter",
    setting: Settings = [],  # noqa: B006 - typer reads the default
    prior: Prior = None,
    as_json: Json = False,
    verbose: Verbose = False,
) -> None:
    """Fly the simulator: take off, survey, choose a zone and land in it."""
    if dashboard is not None:
        extras.require("page", "--dashboard")
    elif not headless:
        dashboard = _page_of_demo()
    if prior is not None:
        extras.require("survey", "--prior")
    set_up_logging(verbose, {})
    from companion.desk.demo import demonstration, flight_files

    high_m = params.check_airworthy(params.load(profile, setting)).survey_height_m
    chosen = sensor_named(sensor or usual_sensor(high_m))
    parameters = params.load(profile, [*chosen.settings_for(scene), *setting])
    compile_at_first(kernel_compilation.of_flight(parameters.mode) | kernel_compilation.of_simulator())
    plan = DemoOptions(
        scene, seed, speedup, out, intruder, point_rate, limit_s, chosen, prior, wind, wind_from
    )
    check(plan)
    with page_endpoint(dashboard, dashboard_token, background) as front:
        summary = demonstration.fly(plan, parameters, err, context.obj, live=not headless, front=front)
    if as_json:
        print(json.dumps(summary))
    else:
        stdout_console().print(flight_files.table(summary))
    if not (summary["landed"] and summary["touchdown_safe"]):
        sys.exit(1)


def _page_of_demo() -> str | None:
    """Return the address of the page that nobody asked for, None where it cannot be served."""
    if (package := extras.missing("page")) is None:
        return DEMO_PAGE
    err.print(extras.explain("no page", package, "page"), markup=False, highlight=False, soft_wrap=True)
    return None
