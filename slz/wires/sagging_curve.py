"""Sagging curve: a straight line over ground whose height is a parabola, fitted to returns.

A catenary h cosh(s / h) departs from the parabola h + s² / 2h by less than 1 mm on a span of 60 m that sags
1 m.
"""

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
