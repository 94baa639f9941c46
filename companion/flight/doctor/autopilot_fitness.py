"""Monitor of the autopilot's parameters, read at the start and at each hand-over."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

from companion.flight.doctor.finding import Finding
from companion.flight.doctor.parameter_check import ABSENT, UNREAD, parameter_findings
from companion.flight.landing.situation import Severity
from companion.flight.link.link import Link
from companion.flight.link.parameter_reader import ParameterReader, parameter_request
from companion.flight.link.vehicle_state import VehicleState
from companion.flight.services.fence_reader import FenceReader
from companion.runtime.clock import now_ns
from params import Required

log = logging.getLogger(__name__)

TICK_S = 0.05
# Retry interval for unread critical parameters, while they keep a landing from beginning.
AGAIN_NS = 10_000_000_000
MOST_TEXTS = 3
FENCE_UNREAD = "fence not read"


class Fitness:
    """Reader of the parameters that `slz doctor` checks; no I/O except in `run`.

    Reads anew whenever the autopilot is found, rebooted, armed or put in the guided mode, and when an order
    is accepted. Faults are reported once, and again when they change; a fault that keeps `--land auto` from
    landing is reported at each hand-over.

    Parameters
    ----------
    auto
        Whether the executive lands without an order.
    odometry
        Whether the LiDAR odometry is sent to the autopilot, so that its parameters are checked too.
    fence
        Reader of the autopilot's fence: unread it counts as a wrong critical parameter.

    Attributes
    ----------
    faults
        Wrong parameters of the last reading, critical ones first.
    """

    def __init__(
        self,
        auto: bool = False,
        odometry: bool = False,
        fence: FenceReader | None = None,
    ) -> None:
        self._auto, self._fence = auto, fence
        self._fence_known = fence is None
        self._odometry = odometry
        self._rows: tuple[Required, ...] = ()
        self._reader: ParameterReader | None = None
        self._read = False  # all read or tried often enough: `faults` is up to date
        self._read_once = False
        self._class_parameter: str | None = None  # asked once in a reading: a copter answers nothing
        self._handed_over = False  # this reading was caused by a hand-over, not by a retry
        self._ended_ns = 0
        self._before: tuple[tuple[object, ...], tuple[bool, ...]] | None = None
        self._firmware: tuple[object, ...] | None = None
        self._had: set[str] = set()  # names that this firmware has
        self._lacking: set[str] = set()  # names for which it did not answer
        self._reported: tuple[tuple[str, str], ...] = ()
        self._texts: list[tuple[Severity, str]] = []
        self.faults: tuple[Finding, ...] = ()

    # ---- state ----------------------------------------------------------------------------------

    @property
    def fit(self) -> bool:
        """True if all critical parameters of its version were read since the last hand-over and are right."""
        return bool(self._rows) and not self._critical()

    @property
    def values(self) -> Mapping[str, float]:
        """Parameters of the newest reading, by name, as far as they have arrived."""
        return {} if self._reader is None else self._reader.values

    @property
    def texts(self) -> tuple[str, ...]:
        """Short texts of the faults; empty during the first reading."""
        return tuple(_said(fault) for fault in self.faults)

    def summary(self) -> dict[str, Any]:
        """Return the entry of the `--json` summary."""
        return {
            "read": self._read_once,
            "fit": self.fit,
            "wrong": [{"name": f.check, "found": f.found, "needed": f.needed} for f in self.faults],
        }

    def _critical(self) -> list[str]:
        """Return the names of critical parameters that are wrong or unread, and the fence while it is unread.

        One that some versions lack is left out once the autopilot is taken to be without it.
        """
        values = self.values
        fence = [] if self._fence_known else [FENCE_UNREAD]
        return fence + [
            row.name
            for row in self._rows
            if row.critical
            and (not row.accepts(values[row.name]) if row.name in values else not self._lacks(row))
        ]

    def _lacks(self, row: Required) -> bool:
        """Return whether this version is taken to be without a parameter."""
        if not row.optional or self._reader is None:
            return False
        return row.name in self._lacking or self._reader.is_unanswered(row.name)

    # ---- events ---------------------------------------------------------------------------------

    def due_requests(self, vehicle: VehicleState, connected: bool, flying: bool, now: int) -> list[Any]:
        """Return the requests to send now; `flying`: an order or an automatic landing is under way."""
        if self._calls_for_reading(vehicle, connected, flying):
            self._begin(vehicle)
            self._handed_over = vehicle.guided and vehicle.armed
        elif self._read and self._unread() and now - self._ended_ns > AGAIN_NS:
            self._begin(vehicle)
        if self._fence is not None:
            self._fence_known = self._fence.is_known(vehicle)
        if self._reader is None or vehicle.sysid is None or not connected:
            return []
        due = self._reader.due(vehicle.sysid, now)
        if self._class_parameter is not None:
            due.append(parameter_request(vehicle.sysid, self._class_parameter))
            self._class_parameter = None
        if not self._read and self._reader.settled and not self._awaited():
            self._read, self._ended_ns = True, now
            self._judge()
            if not self._read_once:
                log.info(
                    "autopilot's parameters read: %s",
                    f"{len(self.faults)} wrong" if self.faults else "all right",
                )
            self._read_once = True
        if self._read and (self._fence is None or self._fence.is_read):
            self._warn(flying)
        return due

    def on_parameter_message(self, message: Any) -> None:
        """Store a PARAM_VALUE or PARAM_ERROR, requested or not."""
        if self._reader is not None:
            self._reader.on_message(message)
            if self._read:
                self._judge()

    def pop_texts(self) -> list[tuple[Severity, str]]:
        """Return the new texts for the pilot and clear them."""
        texts, self._texts = self._texts, []
        return texts

    async def run(self, link: Link, flying: Callable[[], bool]) -> None:
        """Read parameters and report faults until cancelled."""
        forget = [
            link.subscribe(name, lambda message, _: self.on_parameter_message(message))
            for name in ("PARAM_VALUE", "PARAM_ERROR")
        ]
        try:
            while True:
                hears_us = link.connected and link.key_mismatch is None
                for request in self.due_requests(link.vehicle, hears_us, flying(), now_ns()):
                    link.send(request)
                for severity, text in self.pop_texts():
                    log.info(text)
                    link.statustext(text, severity.value)
                await asyncio.sleep(TICK_S)
        finally:
            for unsubscribe in forget:
                unsubscribe()

    # ---- details --------------------------------------------------------------------------------

    def _calls_for_reading(self, vehicle: VehicleState, connected: bool, flying: bool) -> bool:
        """Return whether the vehicle is a new one or was just armed, put in guided mode or given an order."""
        same: tuple[object, ...] = (connected, vehicle.autopilot, vehicle.reboots)
        steps = (vehicle.guided, vehicle.armed, flying)
        before, self._before = self._before, (same, steps)
        if not connected or vehicle.sysid is None:
            return False
        if before is None or before[0] != same:
            return True
        return any(new and not old for new, old in zip(steps, before[1], strict=True))

    def _begin(self, vehicle: VehicleState) -> None:
        firmware = vehicle.autopilot, vehicle.sysid, vehicle.reboots
        if firmware != self._firmware:
            self._had, self._lacking = set(), set()
        elif self._reader is not None:
            self._had |= set(self.values)
            self._lacking |= {row.name for row in self._rows if self._reader.is_unanswered(row.name)}
            self._lacking -= self._had
        self._firmware = firmware
        rows = (
            replace(row, optional=row.optional and row.name not in self._had)
            for row in vehicle.autopilot.required(self._odometry)
        )
        self._rows = tuple(sorted(rows, key=lambda row: (row.optional, not row.critical)))
        self._reader = ParameterReader(self._rows, vehicle.autopilot)
        self._class_parameter = None if vehicle.is_plane else vehicle.autopilot.plane_parameter
        self._read = False

    def _awaited(self) -> bool:
        """Return whether an answer for a critical parameter that some versions lack may still come."""
        return any(
            row.critical and row.optional and row.name not in self.values and not self._lacks(row)
            for row in self._rows
        )

    def _unread(self) -> bool:
        return any(row.critical and not row.optional and row.name not in self.values for row in self._rows)

    def _judge(self) -> None:
        if self._reader is None:
            return
        findings = parameter_findings(self._rows, self._reader.values, self._reader.absent)
        critical = self._critical()
        wrong = [finding for finding in findings if finding.state == "fail"]
        self.faults = tuple(sorted(wrong, key=lambda finding: finding.check not in critical))
        key = tuple((finding.check, finding.found) for finding in self.faults)
        if key != self._reported:
            self._reported = key
            self._tell()

    def _warn(self, flying: bool) -> None:
        """Warn at a hand-over of a critical fault; only an automatic landing waits for its repair."""
        critical, handed_over, self._handed_over = self._critical(), self._handed_over, False
        if not critical or not handed_over:
            return
        if self._auto and not flying:
            self._say(Severity.WARNING, f"no landing by itself: {critical[0]}")
        else:
            self._say(Severity.WARNING, f"landing is at risk: {critical[0]}")

    def _tell(self) -> None:
        if not self.faults:
            self._say(Severity.INFO, "autopilot's parameters are right now")
        shown = len(self.faults) if len(self.faults) <= MOST_TEXTS else MOST_TEXTS - 1
        for fault in self.faults[:shown]:
            self._say(Severity.WARNING, _said(fault))
        if len(self.faults) > shown:
            self._say(Severity.WARNING, f"{len(self.faults) - shown} more are wrong: see slz doctor")

    def _say(self, severity: Severity, text: str) -> None:
        self._texts.append((severity, f"SLZ: {text}"[:50]))


def _said(fault: Finding) -> str:
    text = f"{fault.check} is {fault.found}, needs {fault.needed}"
    if fault.found == UNREAD:
        text = f"{fault.check} could not be read"
    elif fault.found == ABSENT:
        text = f"{fault.check} is missing"
    return text
