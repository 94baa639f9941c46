"""Reports on their way from the pipeline to everyone who uses, shows or records them."""

from __future__ import annotations

import logging
from collections.abc import Callable
from typing import Protocol

from companion.flight.landing.executive import Executive
from companion.flight.landing.landing_point_announcer import LandingPointAnnouncer
from companion.flight.landing.situation import Phase, Severity
from companion.flight.link.link import Link
from companion.flight.outputs.announcers.wire_announcer import WireAnnouncer
from slz import Report

log = logging.getLogger(__name__)


class ReportUser(Protocol):
    """Whoever is handed every report."""

    def use_report(self, report: Report) -> None:
        """Use a report."""


class ReportFeed:
    """Hands reports on and tells the pilot when the selected point changes, and of wires.

    Parameters
    ----------
    users
        Returns whoever uses reports now, in their order.

    Attributes
    ----------
    zones_seen
        IDs of all zones reported so far.
    """

    def __init__(
        self, link: Link, executive: Executive, users: Callable[[], tuple[ReportUser | None, ...]]
    ) -> None:
        self._link, self._executive, self._users = link, executive, users
        self._announcer = LandingPointAnnouncer(executive.state.parameters)
        self._wire_announcer = WireAnnouncer()
        self.zones_seen: set[int] = set()

    def on_report(self, report: Report) -> None:
        """Hand a report on."""
        for user in self._users():
            if user is not None:
                user.use_report(report)
        self.zones_seen.update(zone.id for zone in report.zones)
        self._announce(self._wire_announcer.update(report))
        self._announce(self._announcer.update(report))

    def _announce(self, news: tuple[Severity, str] | None) -> None:
        if news is not None and self._executive.phase is not Phase.FAILSAFE:  # nobody lands there
            log.info(news[1])
            self._link.statustext(news[1], news[0].value)

    def on_invalid(self, reason: str) -> None:
        """Tell the pilot that a report was withdrawn."""
        self._link.statustext(f"SLZ: map invalid: {reason}"[:50], Severity.CRITICAL.value)
