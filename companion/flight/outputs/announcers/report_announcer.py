"""Announcements of what a report changes for the pilot: the selected point, wires, and a withdrawn map."""

from __future__ import annotations

import logging

from companion.flight.landing.executive import Executive
from companion.flight.landing.situation import Phase, Severity
from companion.flight.link.link import Link
from companion.flight.outputs.announcers.landing_point_announcer import LandingPointAnnouncer
from companion.flight.outputs.announcers.wire_announcer import WireAnnouncer
from params import Parameters
from slz import Report

log = logging.getLogger(__name__)


class ReportAnnouncer:
    """Sends the pilot a text when the selected point changes, and for each wire."""

    def __init__(self, link: Link, executive: Executive, parameters: Parameters) -> None:
        self._link, self._executive = link, executive
        self._point, self._wires = LandingPointAnnouncer(parameters), WireAnnouncer()

    def use_report(self, report: Report) -> None:
        """Announce what is new in a report."""
        for news in (self._wires.update(report), self._point.update(report)):
            if news is not None and self._executive.phase is not Phase.FAILSAFE:  # nobody lands there
                log.info(news[1])
                self._link.statustext(news[1], news[0].value)

    def on_invalid(self, reason: str) -> None:
        """Announce that a report was withdrawn."""
        self._link.statustext(f"SLZ: map invalid: {reason}"[:50], Severity.CRITICAL.value)
