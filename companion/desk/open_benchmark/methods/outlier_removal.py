"""Statistical outlier removal, before methods whose publications take clean elevation maps for granted."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.spatial import KDTree

from companion.desk.open_benchmark.landing_task import FlownReturns

NEIGHBOURS, DEVIATIONS = 8, 2.0  # of those tried, with these the methods miss least and find most


def without_outliers(returns: FlownReturns) -> FlownReturns:
    """Return the returns whose mean distance to their nearest neighbours is not unusual.

    Rusu et al., Towards 3D point cloud based object maps for household environments, Robotics and Autonomous
    Systems 56(11), 2008, section 4.1: dropped beyond the mean and two standard deviations of all.
    """
    if len(returns) <= NEIGHBOURS:
        return returns
    apart, _ = KDTree(returns.points_m).query(returns.points_m, k=NEIGHBOURS + 1)
    mean = np.asarray(apart)[:, 1:].mean(axis=1)
    keep = mean <= mean.mean() + DEVIATIONS * mean.std()
    return replace(
        returns,
        points_m=returns.points_m[keep],
        stamp_s=returns.stamp_s[keep],
        window=returns.window[keep],
    )
