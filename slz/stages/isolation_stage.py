"""Stage: outlier removal, and the isolated returns that are judged by many windows together."""

from __future__ import annotations

import numpy as np

from params import Parameters
from slz.kernels.points.histogram import beyond, heights_within
from slz.kernels.points.range_gate import mark_near
from slz.kernels.points.rows import mark
from slz.lanes import MAIN
from slz.points.mapping_reach import reach_m, within
from slz.points.outliers import CLOUD_GROUP, FLIGHT_GROUP, gap_interval, in_cluster, is_dense_at, not_isolated
from slz.window_returns import Flag, Returns

THIN_REACH = 1.2  # of the mapping reach, up to which isolated returns are judged
MOST_LOOKS = 10  # windows in `window_s`: in flight they are as short at the most
SPARSE_LOOKS = 2  # likewise, with which it is the sensor and not the window that has few returns


class Isolation:
    """Finds the returns that no outlier rule drops, and the isolated ones.

    The near map judges the isolated ones together with those of other windows. Where most returns of a
    whole window are isolated, the far map takes them all.
    """

    name, lane = "isolation", MAIN
    reads = frozenset({"places", "USABLE"})
    sets = frozenset({"KEPT", "SPARSE", "NEAR", "ISOLATED", "DISTANT"})

    def run(self, returns: Returns, p: Parameters, /) -> None:
        """Set KEPT, SPARSE, NEAR, ISOLATED, DISTANT."""
        flags, sensor, in_flight = returns.flags, returns.sensor_m, returns.has_place
        rows = returns.rows(Flag.USABLE)
        points = returns.places_m if len(rows) == len(returns) else returns.places(Flag.USABLE)
        span_s = (returns.window.end_ns - returns.window.start_ns) * 1e-9
        looks = min(max(1, round(p.window_s / span_s)), MOST_LOOKS) if span_s > 0 else 1
        # A stored cloud was cleaned by who made it.
        keep = not_isolated(points, sensor, p.cell_m, looks) if in_flight else np.ones(len(points), bool)
        low_m, high_m = gap_interval(heights_within(points, keep), p.outlier_gap_m)
        strays = beyond(points, keep, low_m, high_m)
        keep[strays] = in_cluster(points[strays], *(FLIGHT_GROUP if in_flight else CLOUD_GROUP))
        mark(flags, rows, keep, Flag.KEPT.value)
        if in_flight:
            alone = rows[~keep]
            isolated = returns.places_m[alone]
            dense = is_dense_at(isolated, sensor, looks * len(points))
            judged = within(isolated, sensor, THIN_REACH * reach_m(p)) & ~dense
            flags[alone[judged]] |= np.uint16(Flag.ISOLATED)
            flags[alone[~(judged | dense)]] |= np.uint16(Flag.DISTANT)
            if 2 * len(alone) > len(points) and looks <= SPARSE_LOOKS:
                flags[alone] |= np.uint16(Flag.KEPT | Flag.SPARSE)
        mark_near(returns.places_m, sensor, reach_m(p) ** 2, flags, Flag.NEAR.value)
