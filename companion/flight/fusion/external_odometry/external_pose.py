"""Pose in the frame of an external odometry, and the reasons for which one is not used."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class PosePair:
    """Two poses of the vehicle's forward-right-down axes.

    at_ns : companion clock. auto_m, auto : (3,) and (3, 3), the autopilot's in its map coordinates. stated_m,
    stated : those of the odometry in its own frame. covariance : (6, 6) of the latter. is_stated : whether
    the odometry states it.
    """

    at_ns: int
    auto_m: Floats
    auto: Floats
    stated_m: Floats
    stated: Floats
    covariance: Floats
    is_stated: bool


class Drop(Enum):
    """Reason for which a message is not used: the name of its counter, and the words for it."""

    MALFORMED = "malformed", "malformed message"
    NOT_FINITE = "not_finite", "a number is not finite"
    NOT_UNIT = "not_unit", "quaternion not of length 1"
    BAD_COVARIANCE = "bad_covariance", "bad covariance"
    DISOWNED = "disowned", "covariance says unknown"
    UNSURE = "unsure", "covariance too large"
    OTHER_CLOCK = "other_clock", "stamps of another clock"
    DISORDERED = "disordered", "stamps not in order"
    REPEATED = "repeated", "repeats one pose"
    FOREIGN = "foreign", "of another publisher"
    WITHOUT_POSE = "without_pose", "no autopilot pose then"
    THINNED = "thinned", ""  # more often than needed: no fault

    @property
    def counter(self) -> str:
        """Name of its counter."""
        return self.value[0]

    @property
    def words(self) -> str:
        """Words of at most 26 characters."""
        return self.value[1]


@dataclass(frozen=True, slots=True)
class ExternalPose:
    """Pose of a child frame in the frame of an odometry.

    stamp_ns : publisher's clock as decoded, companion clock once mapped. position_m : (3,).
    rotation : (3, 3), child axes into those of the frame. covariance : (6, 6) of position (m2) and rotation
    vector (rad2) about the frame's axes; `DEFAULT_M`, `DEFAULT_RAD` where the publisher states none.
    is_stated : whether it states its position's. frame, child, publisher : their names.
    """

    stamp_ns: int
    position_m: Floats
    rotation: Floats
    covariance: Floats
    is_stated: bool
    frame: str
    child: str
    publisher: str

    @property
    def origin(self) -> tuple[str, str, str]:
        """Names of frame, child frame and publisher: poses of two origins are not comparable."""
        return self.frame, self.child, self.publisher
