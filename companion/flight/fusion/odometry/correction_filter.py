"""Filter of the correction: what the autopilot's errors may do, and what scan and map say, axis by axis."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
SHIFT, RATE = slice(3, 6), slice(6, 9)
YAW, UP = 2, 5
PLACE, PLACE_RATE = slice(3, 5), slice(6, 8)

# Errors of an autopilot's estimate. A tilt is corrected by gravity: it stays small, and the correction
# returns to zero. Heading and position wander.
TILT_RAD, TILT_S = np.radians(0.3), 20.0
YAW_RAD_SQRT_S, AWAY_M_SQRT_S, UP_M_SQRT_S = np.radians(0.1), 0.02, 0.03
# A drift: that of a position without GPS, 0.034 m/s2 in ArduPilot, or one carried off by a false signal.
RATE_MS, RATE_S = 0.05, 5.0
# A horizontal direction is corrected, and counts as observed, once a usual scan tells it so surely, and while
# one tells it half as surely: less sure ones follow the bias of a few points. Begun at 0.15 m, the estimate
# went 38 m off, in a closed loop with an autopilot.
OBSERVED_M, STILL_OBSERVED_M = 0.08, 0.16
SURE_RAD = np.radians(0.3)
FEWEST_STEEP = 40  # points at steep planes and near steps, below which they may be those of a bush
MOST_STEEP = 160  # that count of a scan: the last ones are forgotten within a second and a half
SURE_UP_M = 0.02
# The last scans together say which axes are determined: a Livox looks in another direction with each.
SCANS = 10.0


class CorrectionFilter:
    """Gaussian filter of rotation vector and shift about the sensor, and of the rate at which this drifts.

    Without GPS an autopilot's position drifts ever faster: a filter without the rate would lag behind, and
    then see nothing of the map within its gate.

    Attributes
    ----------
    covariance
        (9, 9): rotation vector about east, north, up (rad2), shift east, north, up (m2), and the rate of the
        shift (m2/s2).
    observed
        (6,) bool, whether the last scans observed each axis; of the horizontal ones, this scan alone, too:
        what a scan does not observe is the autopilot's own.
    """

    def __init__(self) -> None:
        self.covariance = np.zeros((9, 9))
        self.covariance[RATE, RATE] = np.eye(3) * RATE_MS**2
        self.observed = np.zeros(6, np.bool_)
        self._was_unknown = np.eye(2)
        self._unknown = np.eye(2)  # projection on the horizontal directions that the last scans do not tell
        self._usual, self._usual_steep = np.zeros((6, 6)), 0.0  # of the last scans

    def predict(self, state: Floats, seconds: float) -> Floats:
        """Return the state (9,) after some seconds without a scan; the covariance grows."""
        move = np.eye(9)
        move[SHIFT, RATE] = np.eye(3) * seconds
        move[[0, 1], [0, 1]] = np.exp(-seconds / TILT_S)
        move[RATE, RATE] *= np.exp(-seconds / RATE_S)
        tilt, rate = TILT_RAD**2 * (1 - move[0, 0] ** 2), RATE_MS**2 * (1 - move[6, 6] ** 2)
        grown = np.array([YAW_RAD_SQRT_S, AWAY_M_SQRT_S, AWAY_M_SQRT_S, UP_M_SQRT_S]) ** 2 * seconds
        self.covariance = move @ self.covariance @ move.T + np.diag([tilt, tilt, *grown, rate, rate, rate])
        return np.asarray(move @ state)

    def change(self, away: Floats, left: Floats, right: Floats, steep: int) -> Floats:
        """Return the further change of rotation and shift (6,), which are `away` (6,) from the prediction."""
        information = np.linalg.inv(self.covariance[:6, :6])
        told, said = self._told(left, right, steep)
        change = np.linalg.solve(told + information, said - information @ away)
        change[PLACE] -= self._unknown @ change[PLACE]
        return np.asarray(change)

    def finish(self, away: Floats, left: Floats, steep: int) -> Floats:
        """Return the change of the rates (3,), and take the last normal equations into the covariance.

        Parameters
        ----------
        away
            Rotation and shift (6,) less their prediction.
        steep
            Number of points at steep planes and near steps.
        """
        told, _ = self._told(left, np.zeros(6), steep)
        rates = self.covariance[6:, :6] @ np.linalg.solve(self.covariance[:6, :6], away)
        rates[:2] -= self._unknown @ rates[:2]
        information = np.linalg.inv(self.covariance)
        information[:6, :6] += told
        covariance = np.linalg.inv(information)
        # What is not told does not follow the rest, by what was once told of both.
        unknown = np.zeros((9, 9))
        unknown[PLACE, PLACE] = unknown[PLACE_RATE, PLACE_RATE] = self._unknown
        rest = np.eye(9) - unknown
        self.covariance = rest @ covariance @ rest + unknown @ covariance @ unknown
        self._was_unknown = self._unknown
        self._usual += (left - self._usual) / SCANS
        self._usual_steep += (min(steep, MOST_STEEP) - self._usual_steep) / SCANS
        return np.asarray(rates)

    def known_rates(self, rates: Floats) -> Floats:
        """Return rates (3,) of the shift without those along directions that no recent scan observes."""
        place = rates[:2] - self._unknown @ rates[:2]
        return np.append(place, rates[2] * self.observed[UP])

    def _told(self, left: Floats, right: Floats, steep: int) -> tuple[Floats, Floats]:
        """Return normal equations without the horizontal directions that the scan does not determine.

        Along a wall, or over level ground, little is left of the horizontal information when the heading is
        unknown too: it would follow a few points on a bush.
        """
        usual = self._usual + (left - self._usual) / SCANS
        values, axes = np.linalg.eigh(self._flat(usual))
        many = self._usual_steep + (min(steep, MOST_STEEP) - self._usual_steep) / SCANS >= FEWEST_STEEP
        was_known = 1 - np.einsum("ik,ij,jk->k", axes, self._was_unknown, axes) > 0.5
        least_m = np.where(was_known, STILL_OBSERVED_M, OBSERVED_M)
        known = (values >= 1 / least_m**2) & many
        weak = axes[:, ~known]
        self._unknown = weak @ weak.T
        alone = np.einsum("ik,ij,jk->k", axes, self._flat(left), axes) >= 1 / STILL_OBSERVED_M**2
        unseen = axes[:, ~(known & alone)]
        keep = np.eye(6)
        keep[PLACE, PLACE] -= self._unknown
        turns = weak.shape[1] < 2 and usual[YAW, YAW] >= 1 / SURE_RAD**2
        if not turns:
            keep[YAW, YAW] = 0.0
        self.observed = np.array(
            [
                usual[0, 0] >= 1 / SURE_RAD**2,
                usual[1, 1] >= 1 / SURE_RAD**2,
                turns,
                *(np.diag(unseen @ unseen.T) < 0.1),
                usual[UP, UP] >= 1 / SURE_UP_M**2,
            ]
        )
        return keep @ left @ keep, keep @ right

    def _flat(self, left: Floats) -> Floats:
        """Return the horizontal information (2, 2) of normal equations while the heading is unknown, too."""
        yaw = left[YAW, YAW] + 1 / self.covariance[YAW, YAW]
        return np.asarray(left[3:5, 3:5] - np.outer(left[3:5, YAW], left[3:5, YAW]) / yaw)
