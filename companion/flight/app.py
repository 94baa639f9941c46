"""The application on the vehicle: four parts, built one after the other, and their life."""

from __future__ import annotations

import asyncio
import gc
import logging
from collections.abc import Coroutine
from pathlib import Path
from typing import Any

from companion.flight.deciding import build_deciding
from companion.flight.flight_summary import flight_summary
from companion.flight.landing.executive import Executive
from companion.flight.landing.situation import Severity
from companion.flight.link.link import Link
from companion.flight.link.navigation_source import NavigationSource
from companion.flight.link.wire.signing import Signing
from companion.flight.sensing import Sources, open_sensing
from companion.flight.services.settings import Settings
from companion.flight.services.vehicle_memory import identity_from, remember_vehicle
from companion.flight.telling import Displays, build_telling
from companion.flight.terrain_mapping import build_mapping
from companion.runtime.clock import WallOffset
from companion.runtime.event import Event
from companion.runtime.named_tasks import Stopped, run_together
from companion.runtime.process_tuning import keep_memory
from companion.runtime.state_directory import StateDir
from params import Parameters
from slz import TerrainMaps

log = logging.getLogger(__name__)


class Companion:
    """The whole application.

    Parameters
    ----------
    mavlink_url
        As on the command line.
    sources
        LiDAR and what measures beside it.
    auto
        Land without being asked.
    signing
        Signs the MAVLink link.
    state
        Where to remember what is set in flight; None forgets it.
    record
        File to record the flight in; it holds the data of the first sensor only.
    displays
        Where to show the flight.
    prior
        Folder of a survey to begin with (docs/survey.md).
    system
        The vehicle's MAVLink system; None: the only aircraft heard.

    Attributes
    ----------
    settings, link, executive
        Parameters, MAVLink link and phases of the landing, which the parts share.
    sensing, mapping, deciding, telling
        The parts, each built of those before.
    maps, summary
        Last maps and summary of the flight, after `run`.

    Raises
    ------
    UsageError
        A URL is wrong or its port is in use, or the recording cannot be made.
    """

    def __init__(
        self,
        mavlink_url: str,
        sources: Sources,
        parameters: Parameters,
        *,
        auto: bool,
        signing: Signing | None = None,
        state: StateDir | None = None,
        record: Path | None = None,
        displays: Displays | None = None,
        prior: Path | None = None,
        system: int | None = None,
    ) -> None:
        self.settings = Settings(parameters, state)
        self.parameters = parameters = self.settings.live
        self.link = Link(mavlink_url, parameters, signing, identity_from(state, system))
        if state is not None:
            remember_vehicle(self.link, state)
        wall_offset_ns = WallOffset()
        self.executive = Executive(parameters, auto)
        self.sensing = open_sensing(self.link, parameters, sources, wall_offset_ns)
        self.mapping = build_mapping(
            self.link, self.settings, parameters, self.sensing, self.executive, prior
        )
        self.deciding = build_deciding(
            self.link, parameters, self.sensing, self.mapping, self.executive, state, auto=auto
        )
        self.telling = build_telling(
            self.link, self.settings, parameters, self.sensing, self.mapping, self.deciding,
            displays or Displays(), signing=signing, state=state, wall_offset_ns=wall_offset_ns,
            sends_ranges=not sources.come_by_mavlink,
        )  # fmt: skip
        self.maps: TerrainMaps | None = None
        self.summary: dict[str, Any] = {}
        self.on_ready: Event[[]] = Event()
        self._record = record
        self._stop = asyncio.Event()

    async def run(self) -> None:
        """Run until `stop`; any essential part that fails ends it with that part's error."""
        if self._record is not None:
            self.telling.recordings.start_flight_recording(self._record)
        try:
            failed = await run_together(self._essential() | self._displays())
        finally:
            gc.unfreeze()
            self.telling.close()
            self.maps = self.mapping.worker.close()
            self.summary = flight_summary(self.telling.view)
        if failed is not None:
            raise failed from None

    def stop(self) -> None:
        """End `run`, after telling whoever listens."""
        self._stop.set()

    async def leave(self) -> None:
        """Announce that the companion stops, stop the vehicle, and close the link."""
        flying = self.deciding.is_commanding()
        text = "SLZ: companion stops, take over" if flying else "SLZ: companion stops"
        log.info(text)
        self.link.statustext(text, Severity.CRITICAL.value if flying else Severity.NOTICE.value)
        self.deciding.modes.cancel()
        if flying and self.link.vehicle.guided:
            self.deciding.execution.stop_vehicle()
        await asyncio.sleep(0.2)
        await self.link.close()

    # ---- tasks ----------------------------------------------------------------------------------

    def _essential(self) -> dict[str, Coroutine[Any, Any, None]]:
        """Return the tasks without which nothing is landed, by name."""
        sensing, fitness = self.sensing, self.deciding.fitness
        parts = {
            "link": self.link.run(),
            "lidar": sensing.lidar.run(),
            "services": self.telling.services.run(),
            "fitness": fitness.run(self.link, self.deciding.is_commanding),
            "ready": self._get_ready(),
            "stopper": self._wait_for_stop(),
        }
        if self.parameters.odometry == "autopilot":
            place_by = "LiDAR" if sensing.odometry is None else sensing.odometry.name
            parts["source"] = NavigationSource(place_by).run(
                self.link, sensing.tells_place, self.deciding.autopilot_parameters
            )
        if sensing.ros_odometry is not None:
            parts["odometry"] = sensing.ros_odometry.run()
        if sensing.radar is not None:
            parts["radar"] = sensing.radar.run()
        return parts

    def _displays(self) -> dict[str, Coroutine[Any, Any, None]]:
        """Return the tasks of the displays, which start again by themselves, by name."""
        shown = {"page": self.telling.page, "ros2": self.telling.ros_node}
        return {name: display.run() for name, display in shown.items() if display is not None}

    async def _get_ready(self) -> None:
        """Warm up, then start deciding: nothing compiles in flight, and nothing commands before."""
        self.link.ready = False
        keep_memory()
        await self.mapping.worker.warm_up()
        gc.collect()
        gc.freeze()  # a full collection would stop the streams for a tenth of a second, for what stays anyway
        self.link.ready = True
        self.on_ready.emit()
        log.info("ready" if self.link.connected else "ready: waits for the autopilot")
        telling = self.telling
        async with asyncio.TaskGroup() as group:
            group.create_task(self.mapping.worker.run(), name="pipeline")
            group.create_task(self.deciding.loop.run(self._stop), name="executive")
            group.create_task(telling.streams.run(), name="streams")
            group.create_task(telling.lidar_announcer.run(), name="lidar announcer")
            group.create_task(telling.odometry_announcer.run(), name="odometry announcer")

    async def _wait_for_stop(self) -> None:
        await self._stop.wait()
        await self.leave()
        raise Stopped
