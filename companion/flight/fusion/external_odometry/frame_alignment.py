"""Alignment of an odometry's frame to the map, by attitudes and by the way flown."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from companion.flight.fusion.external_odometry.external_pose import PosePair
from companion.flight.fusion.odometry.correction import Correction

Floats = NDArray[np.float64]

WINDOW_NS = 15_000_000_000
SPACING_NS = 90_000_000
LEAST_WAY_M = 5.0  # horizontal extent of the way
TRACK_M, HEADING_RAD = 0.3, np.radians(4.0)  # errors of an autopilot's way in the window, and of its heading
MOST_TURN_RAD = np.radians(15.0)  # from the way to the attitude: beyond, the child frame is another one
MOST_ANGLE_RAD = np.radians(4.0)  # from the mean of the attitudes
MOST_OFF_M, MOST_OFF = 0.4, 0.05  # of the way: the autopilot's error, and that of a scale
NEEDS_WAY = "needs 5 m of way"


@dataclass(frozen=True, slots=True)
class Alignment:
    """Rigid motion from the frame of the odometry to the map.

    rotation : (3, 3). shift_m : (3,). heading_rad : rotation about up from the autopilot's attitude on the
    map to the aligned one, which is the error of its heading, or of the child frame. sigma_rad : standard
    deviation of the rotation about up.
    """

    rotation: Floats
    shift_m: Floats
    heading_rad: float
    sigma_rad: float


class AlignmentSearch:
    """Search of the alignment over the last poses.

    Both frames are arbitrary: attitudes give the rotation between them, as far as the child frame is the one
    that was named. The way flown shows whether it is, and whether the odometry is of this vehicle:
    so nothing is used before both have flown 5 m horizontally.

    Attributes
    ----------
    reason
        Why there is no alignment yet.
    """

    def __init__(self) -> None:
        self._pairs: deque[tuple[int, Floats, Floats, Floats]] = deque()
        self.reason = NEEDS_WAY

    def add(self, pair: PosePair, on_map: Correction) -> Alignment | None:
        """Return the alignment once the pairs have shown it; on_map: of the autopilot's pose."""
        pairs, at_ns = self._pairs, pair.at_ns
        while pairs and at_ns - pairs[0][0] > WINDOW_NS:
            pairs.popleft()
        if pairs and at_ns - pairs[-1][0] < SPACING_NS:
            return None
        turn = on_map.rotation @ pair.auto @ pair.stated.T
        pairs.append((at_ns, on_map.points(pair.auto_m), pair.stated_m, turn))
        return self._align()

    def _align(self) -> Alignment | None:
        on_map, in_frame = (np.array([pair[k] for pair in self._pairs]) for k in (1, 2))
        turns = Rotation.from_matrix(np.array([pair[3] for pair in self._pairs]))
        mean = turns.mean()
        if float((mean.inv() * turns).magnitude().max()) > MOST_ANGLE_RAD:
            self._refuse("attitude not the vehicle's")
            return None
        extent_m = float(np.linalg.norm(np.ptp(on_map[:, :2], axis=0)))
        if extent_m < LEAST_WAY_M:
            return None
        way, stated_way = on_map - on_map.mean(axis=0), mean.apply(in_frame - in_frame.mean(axis=0))
        (x, y), (a, b) = way[:, :2].T, stated_way[:, :2].T
        turn = float(np.arctan2(a @ y - b @ x, a @ x + b @ y))
        track_rad = TRACK_M / extent_m
        share = HEADING_RAD**2 / (HEADING_RAD**2 + track_rad**2)
        about_up = Rotation.from_rotvec([0.0, 0.0, share * turn])
        off_m = float(np.linalg.norm(way - about_up.apply(stated_way), axis=1).max())
        if abs(turn) > MOST_TURN_RAD:
            self._refuse("way turned from attitude")
            return None
        if off_m > MOST_OFF_M + MOST_OFF * extent_m:
            self._refuse("way not the vehicle's")
            return None
        rotation = np.asarray((about_up * mean).as_matrix())
        sigma_rad = float(1 / np.hypot(1 / HEADING_RAD, 1 / track_rad))
        return Alignment(rotation, on_map[-1] - rotation @ in_frame[-1], share * turn, sigma_rad)

    def _refuse(self, reason: str) -> None:
        """Note why the poses do not fit, and go on with the newer half of them."""
        self.reason = reason
        for _ in range(len(self._pairs) - len(self._pairs) // 2):
            self._pairs.popleft()


class AlignedFrame:
    """Rigid motion from the frame of an odometry to the map, which follows what is learned of it.

    Attributes
    ----------
    rotation
        (3, 3).
    heading_rad
        Rotation about up from the autopilot's attitude to the aligned one while nothing has drifted.
    """

    def __init__(self, alignment: Alignment, pair: PosePair) -> None:
        self.rotation, self._shift_m = alignment.rotation, alignment.shift_m
        self.heading_rad = alignment.heading_rad
        self._anchor_m = self.place_m(pair)

    def place_m(self, pair: PosePair) -> Floats:
        """Vehicle position by odometry, map frame, (3,) m."""
        return np.asarray(self.rotation @ pair.stated_m + self._shift_m)

    def way_m(self, pair: PosePair) -> Floats:
        """Return the way (3,) from where the alignment holds exactly to the vehicle."""
        return self.place_m(pair) - self._anchor_m

    def turn_rad(self, pair: PosePair) -> Floats:
        """Return the rotation vector (3,) on the map from the autopilot's attitude to the odometry's."""
        return np.asarray(Rotation.from_matrix(self.rotation @ pair.stated @ pair.auto.T).as_rotvec())

    def move(self, by_m: Floats) -> None:
        """Move it, and where it holds exactly."""
        self._shift_m = self._shift_m + by_m
        self._anchor_m = self._anchor_m + by_m

    def turn_back(self, turn_rad: float) -> None:
        """Turn it back about up where it holds exactly; the heading of the vehicle stays."""
        self.heading_rad -= turn_rad
        self._turn(np.array([0.0, 0.0, -turn_rad]), self._anchor_m)

    def level(self, pair: PosePair, share: float) -> None:
        """Turn it about the vehicle, by a share of the way to the autopilot's roll and pitch."""
        tilt = -share * self.turn_rad(pair) * (1.0, 1.0, 0.0)
        self._turn(tilt, self.place_m(pair))

    def _turn(self, turn_rad: Floats, pivot_m: Floats) -> None:
        turn = Rotation.from_rotvec(turn_rad).as_matrix()
        self.rotation = turn @ self.rotation
        self._shift_m = pivot_m + turn @ (self._shift_m - pivot_m)
