"""Wire: a power line, a cable or a stay that hangs, as a curve with its height at every place."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray

from slz.kernels.lines.curve_fit import ASIDE_SD, COVARIANCE, FIELDS, MISFIT, fit_returns

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class SaggingCurve:
    """Curve over a straight line.

    place_m, along: (2,) east and north of a point of the line, and its unit direction. heights: (3,) of the
    polynomial z = a + b s + c s² of the distance s along the line from that point (m). covariance: (3, 3) of
    these. aside_sd_m: standard deviation of the line's place across it. misfit: root mean square of the
    residuals over their expected standard deviations.
    """

    place_m: Floats
    along: Floats
    heights: Floats
    covariance: Floats
    aside_sd_m: float
    misfit: float

    @classmethod
    def of(cls, fields: Floats) -> Self:
        """Return the curve of the numbers (FIELDS,) that kernels give."""
        own = fields.copy()
        covariance = own[COVARIANCE:ASIDE_SD].reshape(3, 3)
        return cls(own[:2], own[2:4], own[4:7], covariance, float(own[ASIDE_SD]), float(own[MISFIT]))

    def distances_m(self, points_enu_m: Floats) -> tuple[Floats, Floats]:
        """Return the places (n,) of points along the line, and across it to the left."""
        way = points_enu_m[:, :2] - self.place_m
        return way @ self.along, way @ np.array([-self.along[1], self.along[0]])

    def height_m(self, s: Floats) -> Floats:
        """Return the heights at places (n,) along the line."""
        a, b, c = self.heights
        out: Floats = a + s * (b + s * c)
        return out

    def height_sd_m(self, s: Floats) -> Floats:
        """Return the standard deviations of the heights at places (n,) along the line."""
        powers = np.stack([np.ones_like(s), s, s * s])
        out: Floats = np.sqrt(np.maximum(0.0, np.einsum("in,ij,jn->n", powers, self.covariance, powers)))
        return out

    def points_enu_m(self, s: Floats) -> Floats:
        """Return the points (n, 3) at places along the line."""
        level = self.place_m + s[:, np.newaxis] * self.along
        return np.column_stack([level, self.height_m(s)])


def fit_curve(candidates: Floats) -> SaggingCurve | None:
    """Fit a curve to candidates, two at least; None where they have no direction or none that hangs."""
    fields = np.empty(FIELDS)
    return SaggingCurve.of(fields) if fit_returns(candidates, np.arange(len(candidates)), fields) else None


@dataclass(frozen=True, slots=True, eq=False)
class Wire:
    """Wire in the map frame.

    number: its ID. curve: its place and height. start_m, stop_m: from where to where along the curve it was
    seen. from_m, to_m: the same with what is extrapolated, to the supports that it meets or by the fitted
    curve. at_support: whether it meets a pole or the like at either end. n_returns: returns on it.
    first_seen_ns, last_seen_ns: stamps of the windows with the first and the last.
    """

    number: int
    curve: SaggingCurve
    start_m: float
    stop_m: float
    from_m: float
    to_m: float
    at_support: tuple[bool, bool]
    n_returns: int
    first_seen_ns: int
    last_seen_ns: int

    @property
    def ends_enu_m(self) -> Floats:
        """Return (2, 3) the ends of what was seen."""
        return self.curve.points_enu_m(np.array([self.start_m, self.stop_m]))

    def sampled(self, step_m: float) -> tuple[Floats, Floats, NDArray[np.bool_]]:
        """Return points (n, 3) along all of it, standard deviations of their heights, and which were seen.

        Parameters
        ----------
        step_m
            Greatest distance between neighbours.
        """
        count = max(2, int(np.ceil((self.to_m - self.from_m) / step_m)) + 1)
        s = np.linspace(self.from_m, self.to_m, count)
        seen = (s >= self.start_m) & (s <= self.stop_m)
        return self.curve.points_enu_m(s), self.curve.height_sd_m(s), seen

    def distance_m(self, enu_m: Floats) -> tuple[float, float]:
        """Return the horizontal distance to a place (2,) or (3,), and the height of its nearest point."""
        along_m, _ = self.curve.distances_m(np.reshape(enu_m, (1, -1)))
        near = self.curve.points_enu_m(np.clip(along_m, self.from_m, self.to_m))[0]
        return float(np.hypot(*(near[:2] - enu_m[:2]))), float(near[2])


def nearest_wire(wires: tuple[Wire, ...], enu_m: Floats) -> tuple[Wire, float] | None:
    """Return the wire that passes nearest to a place over ground, and how near; None without wires."""
    if not wires:
        return None
    return min(((wire, wire.distance_m(enu_m)[0]) for wire in wires), key=lambda pair: pair[1])
