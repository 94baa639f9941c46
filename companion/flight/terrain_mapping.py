"""Second part of a flight: from placed scans to reports, obstacles and what moves."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from companion.flight.landing.executive import Executive
from companion.flight.link.link import Link
from companion.flight.mapping.latest_report import LatestReport
from companion.flight.mapping.pipeline_worker import PipelineWorker
from companion.flight.mapping.point_watch import PointWatch
from companion.flight.mapping.recent_obstacles import RecentObstacles
from companion.flight.mapping.vehicle_surroundings import Surroundings
from companion.flight.scan_feed import ScanFeed
from companion.flight.sensing import Sensing
from companion.flight.services.settings import Settings
from params import Parameters

if TYPE_CHECKING:
    from companion.flight.mapping.survey_prior import SurveyPrior


@dataclass(frozen=True, slots=True)
class TerrainMapping:
    """Map, obstacles and moving things.

    Attributes
    ----------
    worker
        Pipeline, in a thread.
    latest
        Newest report of the present map.
    surroundings
        Obstacles and ground around the vehicle.
    watch
        What comes onto the selected point, and what moves.
    feed
        Hands each scan to the others, and begins a new map.
    """

    worker: PipelineWorker
    latest: LatestReport
    surroundings: Surroundings
    watch: PointWatch
    feed: ScanFeed


def build_mapping(
    link: Link,
    settings: Settings,
    parameters: Parameters,
    sensing: Sensing,
    executive: Executive,
    prior: Path | None,
) -> TerrainMapping:
    """Build the map of what `sensing` places, while the executive wants one.

    prior: folder of a survey to begin with, None for none.

    Raises
    ------
    UsageError
        The folder holds no survey for this vehicle.
    """
    worker = PipelineWorker(settings.running, None if prior is None else _surveyed(prior, parameters))
    settings.on_running.subscribe(worker.use)
    latest = LatestReport(parameters, worker.pace)
    obstacles = RecentObstacles(sensing.specks)
    surroundings = Surroundings(obstacles, latest, parameters)
    watch = PointWatch(math.radians(parameters.angle_noise_deg))
    for use_report in (latest.use_report, watch.use_report):
        worker.on_report.subscribe(use_report)
    worker.on_invalid.subscribe(latest.withdraw)
    feed = ScanFeed(link, sensing.history, sensing.assembler, worker, executive, obstacles, watch)
    for begin_map in (latest.begin_map, obstacles.forget):
        feed.on_new_map.subscribe(begin_map)
    sensing.on_lidar_scan.subscribe(feed.add_lidar_scan)
    sensing.on_radar_scan.subscribe(feed.add_radar_scan)
    return TerrainMapping(worker, latest, surroundings, watch, feed)


def _surveyed(folder: Path, parameters: Parameters) -> SurveyPrior:
    from companion.flight.mapping.survey_prior import SurveyPrior  # libraries of maps, only where used

    return SurveyPrior(folder, parameters)
