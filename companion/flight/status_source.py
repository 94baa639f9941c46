"""State of the landing as numbers for ground stations."""

from __future__ import annotations

from companion.flight.flight_view import FlightView
from companion.flight.outputs.landing_status import Status
from companion.runtime.clock import now_ns
from slz import Report


def landing_status(flight: FlightView, report: Report | None) -> Status:
    """Return the state of the landing; report: the newest one, None unless it is fresh."""
    nan = float("nan")
    selected = None if report is None else report.selected
    best = report.zones[0] if report is not None and report.zones else None
    pose = flight.history.latest(now_ns())
    over = nan if pose is None or selected is None else float(pose.position_enu_m[2]) - selected.height_m
    timesync = flight.link.inbox.clock.timesync
    return Status(
        phase=flight.executive.phase.value,
        zones=0 if report is None else len(report.zones),
        best_zone=nan if best is None else best.id,
        point="none" if selected is None else selected.state.value,
        certainty=selected.certainty if selected is not None else nan if best is None else best.certainty,
        height_m=over,
        latency_ms=flight.worker.age_ms,
        dropped=flight.worker.dropped_windows + flight.link.statistics().dropped,
        sync_ms=timesync.residual_ns * 1e-6 if timesync.synced else nan,
    )
