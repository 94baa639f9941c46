"""Frame of an odometry that is aligned to the map."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from companion.flight.fusion.external_odometry.frame_alignment import Alignment
from companion.flight.fusion.external_odometry.pose_pair import PosePair

Floats = NDArray[np.float64]


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
        """Return where on the map the odometry tells the vehicle, (3,)."""
        return np.asarray(self.rotation @ pair.told_m + self._shift_m)

    def way_m(self, pair: PosePair) -> Floats:
        """Return the way (3,) from where the alignment holds exactly to the vehicle."""
        return self.place_m(pair) - self._anchor_m

    def turn_rad(self, pair: PosePair) -> Floats:
        """Return the rotation vector (3,) on the map from the autopilot's attitude to the odometry's."""
        return np.asarray(Rotation.from_matrix(self.rotation @ pair.told @ pair.auto.T).as_rotvec())

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
