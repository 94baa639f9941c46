"""Options that several commands share."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from companion.runtime import extras
from params import PROFILES

LIDAR = (
    "livox:, velodyne: or ouster:HOST:PORT, lightware:/dev/ttyX,BAUD, ros2:/TOPIC, or mavlink:"
    " (docs/sensors.md)."
)
Key = Annotated[
    Path | None,
    typer.Option(help="File with the key of MAVLink signing: 32 bytes, 64 hex digits or a passphrase."),
]
State = Annotated[
    Path | None, typer.Option(help="Folder for what is set in flight.", show_default="$XDG_STATE_HOME/slz")
]
Profile = Annotated[str, typer.Option(help=f"{', '.join(PROFILES)} or a TOML file.")]
Settings = Annotated[list[str], typer.Option("--set", metavar="NAME=VALUE", help="Set one parameter.")]
System = Annotated[
    int | None,
    typer.Option(min=1, max=255, help="MAVLink system of the vehicle, where several are heard."),
]
Json = Annotated[bool, typer.Option("--json", help="Print one JSON object on stdout.")]
Dashboard = Annotated[
    str | None, typer.Option(metavar="HOST:PORT", help="Serve the pilot's page (docs/page.md).")
]
DashboardToken = Annotated[
    Path | None,
    typer.Option(help="File with lines 'operator TOKEN', 'viewer TOKEN': needed but on 127.0.0.1."),
]


def _background(file: str) -> Any:
    """Open the picture while the arguments are read: a bad one ends the start before kernels are compiled."""
    extras.require("survey", "--background")
    from companion.flight.dashboard.background_picture import BackgroundPicture

    return BackgroundPicture(Path(file))


Background = Annotated[
    Any, typer.Option(parser=_background, metavar="FILE", help="GeoTIFF or MBTiles beneath the page's map.")
]
Prior = Annotated[
    Path | None,
    typer.Option(metavar="DIR", help="Survey of slz map to begin with: where to look first."),
]
Ros2 = Annotated[
    str | None,
    typer.Option(metavar="zenoh[:tcp/HOST:PORT]", help="Be a ROS 2 node by a Zenoh router (docs/ros2.md)."),
]
Ros2Odometry = Annotated[
    str | None,
    typer.Option(
        metavar="/TOPIC[?lidar]", help="Odometry of a ROS 2 node that tells the place (docs/ros2.md)."
    ),
]
Verbose = Annotated[bool, typer.Option("--verbose", "-v", help="Log more, to stderr.")]
