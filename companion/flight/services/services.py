"""Services on the link: parameters and their metadata, rally points, fence, and the timestamp of signing."""

from __future__ import annotations

import asyncio
import logging
from pathlib import Path
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from companion.flight.link.link import Link
from companion.flight.link.mission_protocol import RallyPoint
from companion.flight.link.wire.signing import HIGHEST_TICK, Signing
from companion.flight.link.wire.signing_key import read_key
from companion.flight.mapping.latest_report import LatestReport
from companion.flight.services.fence_reader import FenceReader
from companion.flight.services.parameter_server import ParameterHolder, ParameterServer
from companion.flight.services.rally_points import TRANSFERS, Rally, best_points
from companion.flight.services.settings import Settings
from companion.runtime.clock import now_ns
from companion.runtime.state_directory import StateDir
from slz import Report

log = logging.getLogger(__name__)

TICK_S = 0.05
SIGNING_FILE = "signing"
RALLY_FILE = "rally"


def start_signing(key_file: Path, state: StateDir) -> Signing:
    """Read the key and resume the timestamp of the last flight, or begin with the date without one.

    Raises
    ------
    UsageError
        The key is refused, or the timestamp's file cannot be read at all.
    """
    key = read_key(key_file)
    text = state.read(SIGNING_FILE, damaged=True)
    text = "0" if text is None else text.strip()
    tick = _tick(text)
    if tick is None:
        path = state.folder / SIGNING_FILE
        log.warning("%s: %r is no timestamp; those of signing begin with the date", path, text[:20])
    log.info("MAVLink is signed: the key is %s", key.form)
    return Signing(key.secret, tick or 0)


def _tick(text: str) -> int | None:
    """Return the timestamp in a text, None if it is invalid."""
    if not (text.isascii() and text.isdigit() and len(text) <= len(str(HIGHEST_TICK))):
        return None
    return int(text) if int(text) <= HIGHEST_TICK else None


class Services:
    """Serves parameters and their metadata to stations, and the best zones to the autopilot as rally points.

    Parameters
    ----------
    link, settings
        Source of the requests, and holder of the values.
    signing, state
        Signing of the link; state directory for its timestamp and our rally points.
    latest
        Newest report, None for a program without a map.
    orders
        Parameters that are orders.
    fence
        Reader of the autopilot's fence.
    """

    def __init__(
        self,
        link: Link,
        settings: Settings,
        signing: Signing | None = None,
        state: StateDir | None = None,
        latest: LatestReport | None = None,
        orders: tuple[ParameterHolder, ...] = (),
        fence: FenceReader | None = None,
    ) -> None:
        self._link = link
        self.fence = FenceReader() if fence is None else fence
        self._settings = settings
        self._latest = latest
        self._seen: Report | None = None
        self._points: tuple[RallyPoint, ...] = ()
        self._signing = signing
        self._state = state
        self._unsynced = False
        self.parameters = ParameterServer(settings, *orders)
        self.parameters.on_change_result.subscribe(self._tell)
        for name in ("PARAM_REQUEST_LIST", "PARAM_REQUEST_READ", "PARAM_SET"):
            link.subscribe(name, self._parameter, anyone=True)
        self._remembered = () if state is None else _read_points(state)
        self.rally = Rally(self._remembered)
        for name in sorted(TRANSFERS):
            link.subscribe(name, self._mission, anyone=True)
        for name in ("PARAM_VALUE", "PARAM_ERROR"):
            link.subscribe(name, lambda message, _: self.fence.on_parameter(message))

    async def run(self) -> None:
        """Send due messages until cancelled."""
        try:
            while True:
                for message in self.parameters.poll(now_ns()):
                    self._link.send(message)
                self._keep_rally_points()
                self._read_fence()
                await self._sync_points()
                await self._save_timestamp()
                await asyncio.sleep(TICK_S)
        finally:
            if self._signing is not None:
                self._write_timestamp(self._signing.tick)

    def _parameter(self, message: Any, _at_ns: int) -> None:
        self.parameters.bytewise = self._link.vehicle.autopilot.bytewise_parameters
        for answer in self.parameters.on_message(message, self._link.system_id, self._link.component_id):
            self._link.send(answer)

    def _mission(self, message: Any, at_ns: int) -> None:
        link = self._link
        if link.vehicle.sysid is not None:
            us = (link.system_id, link.component_id)
            self._send_mission(self.rally.on_message(message, at_ns, link.vehicle.sysid, us))
            self._send_mission(self.fence.on_mission(message, at_ns, link.vehicle.sysid, us))

    def _keep_rally_points(self) -> None:
        link = self._link
        if link.vehicle.sysid is None or not (link.connected or self.rally.busy) or self.fence.busy:
            return
        us = (link.system_id, link.component_id)
        self._send_mission(self.rally.poll(now_ns(), self._wanted_points(), link.vehicle.sysid, us))

    def _read_fence(self) -> None:
        """Read the fence while nobody else transfers: PX4 may break a station's upload off for it."""
        link, at_ns = self._link, now_ns()
        us, quiet = (link.system_id, link.component_id), self.rally.is_quiet(at_ns)
        for message in self.fence.poll(at_ns, link.vehicle, link.connected, us, quiet=quiet):
            link.send(message)

    def _wanted_points(self) -> tuple[RallyPoint, ...] | None:
        """Return the rally points for the vehicle, None to leave them unchanged."""
        parameters, vehicle = self._settings.running, self._link.vehicle
        if vehicle.no_command_reason:  # where a wing returns to, it circles; a VTOL keeps what it has
            return None
        if parameters.rally == "off" or not vehicle.armed:
            return ()
        report = None if self._latest is None else self._latest.valid(now_ns())
        if report is None:
            return None
        if report is not self._seen:  # once per report, because the tick is twenty times as fast
            fence = self.fence.geofence(vehicle, report.frame)
            self._seen, self._points = report, best_points(report, vehicle, parameters, fence)
        return self._points

    def _send_mission(self, messages: list[Any]) -> None:
        """Store our points, because the program may die before they are removed; then send."""
        if self._state is not None and self.rally.ours != self._remembered:
            self._remembered = self.rally.ours
            lines = "".join(f"{p.lat_e7} {p.lon_e7} {p.alt_m}\n" for p in self._remembered)
            if fault := self._state.write(RALLY_FILE, lines, durable=False):
                log.warning("our rally points are not remembered: %s", fault)
            self._unsynced = not fault
        for message in messages:
            self._link.send(message)

    def _tell(self, text: str, accepted: bool) -> None:
        log.info(text)
        self._link.statustext(text, mavlink.MAV_SEVERITY_INFO if accepted else mavlink.MAV_SEVERITY_WARNING)

    async def _sync_points(self) -> None:
        """Sync our points to disk against a power cut; in a thread, because nothing here may wait for it."""
        if self._unsynced and self._state is not None:
            self._unsynced = False
            if fault := await asyncio.to_thread(self._state.sync, RALLY_FILE):
                log.warning("our rally points are not kept: %s", fault)

    async def _save_timestamp(self) -> None:
        tick = None if self._signing is None else self._signing.to_save()
        if tick is not None:
            await asyncio.to_thread(self._write_timestamp, tick)

    def _write_timestamp(self, tick: int) -> None:
        if self._state is not None and (fault := self._state.write(SIGNING_FILE, f"{tick}\n")):
            log.warning("the timestamp of signing is not kept: %s", fault)


def _read_points(state: StateDir) -> tuple[RallyPoint, ...]:
    """Return the points that an earlier run may have left on the vehicle, without invalid lines."""
    points = []
    for line in (state.read(RALLY_FILE, damaged=True) or "").splitlines():
        try:
            lat_e7, lon_e7, alt_m = map(int, line.split())
            points.append(RallyPoint(lat_e7, lon_e7, alt_m))
        except ValueError:
            log.warning("%s: %r is no rally point", state.folder / RALLY_FILE, line[:40])
    return tuple(points)
