"""`slz doctor`: checks of vehicle and computer."""

from __future__ import annotations

import json
import sys
from typing import Annotated

import typer

import params
from companion.cli.console import set_up_logging, stdout_console
from companion.cli.options import LIDAR, Json, Key, Profile, Settings, State, System, Verbose


def doctor(
    mavlink: Annotated[str, typer.Option(help="udpin:HOST:PORT, tcp:HOST:PORT or /dev/ttyX,BAUD.")],
    lidar: Annotated[str, typer.Option(help=LIDAR)],
    seconds: Annotated[float, typer.Option(min=3.0, max=600.0, help="How long to listen.")] = 10.0,
    system: System = None,
    mavlink_key: Key = None,
    state_dir: State = None,
    profile: Profile = "quadcopter",
    setting: Settings = [],  # noqa: B006
    as_json: Json = False,
    verbose: Verbose = False,
) -> None:
    """Check link, clock, autopilot parameters, LiDAR and this computer; exit 1 if what is needed is wrong."""
    set_up_logging(verbose, {})
    from companion.flight.doctor import consultation

    parameters = params.load(profile, setting)
    signing = None
    if mavlink_key is not None:
        from companion.flight.services.services import start_signing
        from companion.runtime.state_directory import StateDir, default_state_dir

        signing = start_signing(mavlink_key, StateDir(state_dir or default_state_dir()))
    findings = consultation.examine(mavlink, lidar, parameters, seconds, signing, system)
    summary = consultation.document(findings)
    if as_json:
        print(json.dumps(summary))
    else:
        stdout_console().print(consultation.table(findings))
    if not summary["ok"]:
        sys.exit(1)
