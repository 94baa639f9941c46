"""Obstacles and ground around the vehicle: fresh returns, the map's cells, and wires."""

from __future__ import annotations

import numpy as np

from companion.flight.geometry.axes import Floats, level_frd_m
from companion.flight.geometry.pose import Pose
from companion.flight.mapping.clearance import height_m
from companion.flight.mapping.latest_report import LatestReport
from companion.flight.mapping.recent_obstacles import RecentObstacles
from companion.runtime.clock import now_ns
from params import Parameters
from slz import Nearby, Report

CELL_POINTS = 3  # returns that a cell of the map, or a place of a wire, counts as
FARTHEST_M = 50.0  # of an obstacle from the vehicle
REPORT_NS = 5_000_000_000  # age from which a map does not show the present obstacles
STEP_M = 0.5


class Surroundings:
    """Everything known around the vehicle, for those who avoid it and those who report it.

    Attributes
    ----------
    returns
        Returns of the latest scans.
    latest
        Newest report.
    """

    def __init__(self, returns: RecentObstacles, latest: LatestReport, parameters: Parameters) -> None:
        self.returns, self.latest, self._parameters = returns, latest, parameters

    def nearby(self) -> Nearby | None:
        """Return the map around the vehicle, None without one that is new enough."""
        report, arrived_ns = self.latest.newest, self.latest.arrived_ns
        if report is None or arrived_ns is None or now_ns() - arrived_ns > REPORT_NS:
            return None
        return report.nearby

    def wires_enu_m(self, position_enu_m: Floats, reach_m: float) -> Floats:
        """Return points (n, 3) along the wires around a position; they stay however old the report is."""
        return wire_points_enu_m(self.latest.newest, position_enu_m, reach_m)

    def height_m(self, position_enu_m: Floats, at_ns: int) -> float:
        """Return the height above ground (m), NaN while unknown."""
        return height_m(position_enu_m, at_ns, self.returns, self.nearby(), self._parameters.relief_m)

    def level_frd_m(self, pose: Pose, at_ns: int, low_m: float) -> Floats:
        """Return obstacles (n, 3) in level forward-right-down axes of a pose, m.

        Cells reach from the ground to their tops; those lower than `low_m` below the vehicle are left out. A
        cell and a place of a wire count as `CELL_POINTS` points, so that they are not taken for dust.
        """
        fresh, around = self.returns.level_frd_m(pose, at_ns), self.nearby()
        solid = self.wires_enu_m(pose.position_enu_m, FARTHEST_M)
        if around is not None:
            columns = around.columns_enu_m(float(pose.position_enu_m[2]) - low_m)
            columns[:, 2] = np.minimum(columns[:, 2], pose.position_enu_m[2])
            solid = np.concatenate([columns, solid])
        return np.concatenate([fresh, np.repeat(level_frd_m(solid, pose), CELL_POINTS, axis=0)])


def wire_points_enu_m(report: Report | None, position_enu_m: Floats, reach_m: float) -> Floats:
    """Return points (n, 3) along the wires of a report that are within a distance of a position.

    Extrapolated parts are included: a wire goes on beyond what was seen.
    """
    parts = [np.empty((0, 3))]
    for wire in () if report is None else report.wires:
        points, _, _ = wire.sampled(STEP_M)
        away_m = np.linalg.norm(points - position_enu_m, axis=1)
        parts.append(points[away_m <= reach_m])
    return np.concatenate(parts)
