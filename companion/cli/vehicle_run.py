"""Command `slz run`: the companion on the vehicle, in real time."""

from __future__ import annotations

import asyncio
import logging
import signal
from pathlib import Path
from typing import TYPE_CHECKING, Any

from companion.flight.app import Companion
from companion.flight.fusion.external_odometry.odometry_topic import parse_odometry_topic
from companion.flight.rmw.zenoh_url import parse_zenoh_url
from companion.flight.sensing import Sources
from companion.flight.services.services import start_signing
from companion.flight.telling import Displays
from companion.runtime import output_folder
from companion.runtime.process_tuning import real_time_priority
from companion.runtime.state_directory import StateDir
from companion.runtime.watchdog import Watchdog
from params import Parameters

if TYPE_CHECKING:
    from companion.flight.dashboard.page import PageEndpoint

log = logging.getLogger(__name__)

HANGS_S = 20.0  # a window takes a fraction of a second


def run(
    mavlink_url: str,
    lidar_url: str,
    auto: bool,
    parameters: Parameters,
    out: Path | None,
    state: StateDir,
    *,
    key_file: Path | None = None,
    record: Path | None = None,
    radar_url: str | None = None,
    front: PageEndpoint | None = None,
    foxglove_port: int | None = None,
    prior: Path | None = None,
    system: int | None = None,
    ros2: str | None = None,
    ros2_odometry: str | None = None,
) -> dict[str, Any]:
    """Run until SIGTERM or SIGINT and return the summary; raise the error that ended the run otherwise.

    With `out`, draw the maps, the flown path and the chosen point at the end. A failure to draw is logged as
    one warning, because the flight's summary is worth more than its pictures.

    Raises
    ------
    UsageError
        A URL is wrong, its port is in use, the key is refused, the folder cannot be created or written, or
        two systems may be the vehicle.
    """
    if out is not None:
        output_folder.prepare(out)
    signing = None if key_file is None else start_signing(key_file, state)

    async def fly() -> dict[str, Any]:
        companion = Companion(
            mavlink_url,
            Sources(
                lidar_url,
                radar_url,
                None if ros2 is None else parse_zenoh_url(ros2),
                None if ros2_odometry is None else parse_odometry_topic(ros2_odometry),
            ),
            parameters,
            auto=auto,
            signing=signing,
            state=state,
            record=record,
            displays=Displays(front, foxglove_port),
            prior=prior,
            system=system,
        )
        return await _run(companion, out)

    return asyncio.run(fly())


async def _run(companion: Companion, out: Path | None) -> dict[str, Any]:
    loop = asyncio.get_running_loop()
    for number in (signal.SIGTERM, signal.SIGINT):
        loop.add_signal_handler(number, companion.stop)
    watchdog = Watchdog(lambda: not companion.mapping.worker.hangs(HANGS_S))
    signs = asyncio.create_task(watchdog.run(), name="watchdog")
    companion.on_ready.subscribe(watchdog.ready)
    try:
        with real_time_priority():
            await companion.run()
    finally:
        watchdog.stopping()
        signs.cancel()
    if out is not None:
        _try_to_draw(companion, out)  # within the loop: its handlers keep a second signal from ending it
    return companion.summary


def _try_to_draw(companion: Companion, out: Path) -> None:
    from companion.desk.figures import draw_flight

    try:
        draw_flight(companion, out)
    except Exception as error:  # a full disk, or any error of the drawing library
        log.warning("the maps could not be drawn into %s: %s", out, " ".join(str(error).split()))
