"""Moving objects around the vehicle, from every scan: raised returns, their groups, and tracks of these."""

from __future__ import annotations

from collections import deque

import numpy as np

from slz.frame import LocalFrame
from slz.landing_point.local_heights import Nearby
from slz.moving.groups import groups
from slz.moving.raised_returns import Ground, RaisedReturns, RecentGround, raised_returns
from slz.moving.tracks import MovingObject, Tracks
from slz.window import Scan

KEPT_NS = 400_000_000  # returns that are grouped together: a person 25 m away returns some in this time
STEP_NS = 45_000_000  # between two updates of the tracks
GROUND_NS = 500_000_000  # between two reports whose ground is taken: what changes in less moves


class MovingObjects:
    """Detector and tracker of what moves over the ground that the newest report knows.

    Parameters
    ----------
    angle_noise_rad
        Standard deviation of a ray's direction.

    Attributes
    ----------
    found
        What moves now.
    """

    def __init__(self, angle_noise_rad: float) -> None:
        self._angle_noise_rad = angle_noise_rad
        self._ground: Ground | None = None
        self._ground_ns = 0
        self._recent = RecentGround()
        self._newest_ns = 0
        self._frame: LocalFrame | None = None
        self._tracks = Tracks()
        self._kept: deque[RaisedReturns] = deque()
        self._updated_ns = 0
        self.found: tuple[MovingObject, ...] = ()

    def use_ground(self, nearby: Nearby | None) -> None:
        """Compare scans with the ground of a report from now on, None for none; with one each half second."""
        if nearby is None:
            self._ground, self.found = None, ()
            self._recent.forget()
        elif self._ground is None or not 0 <= self._newest_ns - self._ground_ns < GROUND_NS:
            self._ground, self._ground_ns = self._recent.add(nearby, self._newest_ns), self._newest_ns

    def forget(self) -> None:
        """Forget ground and tracks: a new map begins."""
        self._ground, self.found = None, ()
        self._tracks.forget()
        self._recent.forget()
        self._kept.clear()

    def add(self, scan: Scan) -> tuple[MovingObject, ...]:
        """Take a scan; return what moves now."""
        if not len(scan):
            return self.found
        self._newest_ns = now_ns = int(scan.stamp_ns[-1])
        if self._ground is None:
            return self.found
        if scan.frame != self._frame or now_ns < self._updated_ns:
            self._tracks.forget()
            self._kept.clear()
            self._recent.forget()
            self._frame, self._updated_ns = scan.frame, 0
        new = raised_returns(scan, self._ground, self._angle_noise_rad)
        if new is not None:
            self._kept.append(new)
        while self._kept and now_ns - int(self._kept[0].stamp_ns[-1]) > KEPT_NS:
            self._kept.popleft()
        if now_ns - self._updated_ns < STEP_NS:
            return self.found
        self._updated_ns = now_ns
        together = (
            []
            if not self._kept
            else groups(
                np.concatenate([k.points_enu_m for k in self._kept]),
                np.concatenate([k.over_m for k in self._kept]),
                np.concatenate([k.stamp_ns for k in self._kept]),
            )
        )
        self.found = self._tracks.update(together, now_ns)
        return self.found
