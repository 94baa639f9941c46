"""Landing status for ground stations: NAMED_VALUE_FLOAT, once a second."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

from companion.flight.fusion.pose_history import PoseHistory
from companion.flight.landing.executive import Executive
from companion.flight.link.link import Link
from companion.flight.link.statustext import named_value
from companion.flight.mapping.latest_report import LatestReport
from companion.flight.mapping.pipeline_worker import PipelineWorker
from companion.runtime.clock import now_ns

PHASES = ("idle", "survey", "approach", "descend", "final", "landed", "climb", "hold", "failsafe")
POINTS = ("none", "safe", "unsafe", "unknown")


@dataclass(frozen=True, slots=True)
class Status:
    """Values to send; NaN is not sent.

    phase, point: one of `PHASES`, of `POINTS`. zones: their number. best_zone: ID of the best ranked zone.
    certainty: probability that the selected point is safe, else that of the best zone. height_m: over the
    selected point. latency_ms: median age of the newest window's returns at its report. dropped: windows,
    and messages that no channel accepted. sync_ms: residual of TIMESYNC. here_m, here_deg: distance and
    bearing of the nearest place to land on, 0 m where it is safe below, -1 m where none is within reach.
    """

    phase: str
    zones: int
    best_zone: float
    point: str
    certainty: float
    height_m: float
    latency_ms: float
    dropped: int
    sync_ms: float
    here_m: float = math.nan
    here_deg: float = math.nan


def landing_status(
    link: Link, history: PoseHistory, worker: PipelineWorker, latest: LatestReport, executive: Executive
) -> Status:
    """Return the state of the landing by the newest report, if it is fresh."""
    nan, now = float("nan"), now_ns()
    report, pose = latest.fresh(now), history.latest(now)
    selected = None if report is None else report.selected
    best = report.zones[0] if report is not None and report.zones else None
    over = nan if pose is None or selected is None else float(pose.position_enu_m[2]) - selected.height_m
    timesync, here = link.inbox.clock.timesync, executive.assist.now
    return Status(
        phase=executive.phase.value,
        zones=0 if report is None else len(report.zones),
        best_zone=nan if best is None else best.id,
        point="none" if selected is None else selected.state.value,
        certainty=selected.certainty if selected is not None else nan if best is None else best.certainty,
        height_m=over,
        latency_ms=worker.age_ms,
        dropped=worker.dropped_windows + link.statistics().dropped,
        sync_ms=timesync.residual_ns * 1e-6 if timesync.synced else nan,
        here_m=nan if here is None else here.number_m,
        here_deg=nan if here is None else here.bearing_deg,
    )


def status_messages(status: Status, boot_ms: int) -> list[Any]:
    """Return a message for each known value; -1 stands for a phase or point state that is not listed."""
    values = {
        "SLZ_PHASE": _number(status.phase, PHASES),
        "SLZ_ZONES": status.zones,
        "SLZ_BEST": status.best_zone,
        "SLZ_POINT": _number(status.point, POINTS),
        "SLZ_SURE": status.certainty,
        "SLZ_HEIGHT": status.height_m,
        "SLZ_LATE": status.latency_ms,
        "SLZ_DROPS": status.dropped,
        "SLZ_SYNC": status.sync_ms,
        "SLZ_HERE_M": status.here_m,
        "SLZ_HERE_D": status.here_deg,
    }
    return [
        named_value(name, float(value), boot_ms) for name, value in values.items() if math.isfinite(value)
    ]


def _number(name: str, names: tuple[str, ...]) -> int:
    return names.index(name) if name in names else -1
