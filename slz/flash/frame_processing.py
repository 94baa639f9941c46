"""Processing of one flash frame: from waveforms to a filtered range image and to points."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
from functools import cache
from typing import Literal

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from slz.flash.camera import FlashCamera, FlashFrame
from slz.flash.ranging import RangeImage, likely_ranges, polynomial_ranges
from slz.kernels.instruments.waveform import GOOD, MISSING, SATURATED

F64 = NDArray[np.float64]
FULL = 0.95
"""Share of GOOD pixels, "close to 100 %", from which a frame is whole."""
LIMIT = (0.5, 0.7)
"""Shares of GOOD pixels of a frame at the limit of detection."""
MOST_SATURATED = 0.2
Estimator = Literal["likely", "polynomial"]
PARTED = 4.0  # standard errors, and
PARTED_M = 0.5  # metres by which a pixel may differ from the median around it; the greater one


def median_of_neighbours(image: F64) -> F64:
    """Return the median of the known pixels among 9, 6 at edges and 4 at corners (Flash paper, Eq. (1)).

    Where no more than half of them are known, the result is NaN: a hole is not filled from its rim.
    """
    windows = np.sort(_windows(image, np.nan), axis=-1)  # what is missing comes last
    known = 9 - np.isnan(windows).sum(axis=-1, keepdims=True)
    low, high = (np.take_along_axis(windows, k, axis=-1)[..., 0] for k in ((known - 1) // 2, known // 2))
    present = _windows(np.ones(image.shape), 0.0).sum(axis=-1)
    return np.where(2 * known[..., 0] > present, 0.5 * (low + high), np.nan)


def _windows(image: F64, beyond: float) -> F64:
    """Return (rows, cols, 9) the neighbourhood of each pixel, with one value for all beyond the image."""
    padded = np.pad(image, 1, constant_values=beyond)
    return sliding_window_view(padded, (3, 3)).reshape(*image.shape, 9)


class Quality(Enum):
    """Quality of a frame. Only WHOLE and PARTIAL frames are mapped."""

    WHOLE = "whole"
    PARTIAL = "partial"
    LIMIT = "at the limit of detection"
    SATURATED = "saturated"
    EMPTY = "empty"


@dataclass(frozen=True, slots=True)
class Triage:
    """Quality of a frame, with the shares of its pixels that gave a return and that were saturated."""

    quality: Quality
    returned: float
    saturated: float

    @property
    def usable(self) -> bool:
        """True if the ranges of the frame are mapped."""
        return self.quality in (Quality.WHOLE, Quality.PARTIAL)


def triage(image: RangeImage) -> Triage:
    """Classify a frame by its shares of GOOD and of saturated pixels.

    Between 70 and 95 % the frame is partial, a case that the source does not name: its returns are used, and
    the rest stays unknown. Below 50 % noise triggers too large a share of the returns.
    """
    returned = float(np.mean(image.state != MISSING))
    saturated = float(np.mean(image.state == SATURATED))
    good = float(np.mean(image.state == GOOD))
    if saturated > MOST_SATURATED:
        quality = Quality.SATURATED
    elif good < LIMIT[0]:
        quality = Quality.EMPTY
    elif good <= LIMIT[1]:
        quality = Quality.LIMIT
    else:
        quality = Quality.WHOLE if good >= FULL else Quality.PARTIAL
    return Triage(quality, returned, saturated)


@dataclass(frozen=True, slots=True)
class FlashImage:
    """Range image of one frame; arrays (rows, cols).

    measured : ranges pixel by pixel. filtered_m : median over the neighbours, with holes of single pixels
    repaired, NaN where unknown. repaired : bool, where a filtered range has no measured one at its pixel.
    """

    measured: RangeImage
    filtered_m: F64
    repaired: NDArray[np.bool_]
    triage: Triage
    stamp_ns: int


def process_frame(frame: FlashFrame, camera: FlashCamera, estimator: Estimator = "likely") -> FlashImage:
    """Run a frame through ranging, triage and median filter (Flash paper, sections 4.2-5.1).

    Raises
    ------
    ValueError
        The frame does not fit this camera, or the estimator is unknown.
    """
    if estimator not in ("likely", "polynomial"):
        raise ValueError(f"flash: no estimator is called {estimator!r}: use 'likely' or 'polynomial'")
    measured = (likely_ranges if estimator == "likely" else polynomial_ranges)(frame, camera)
    filtered = median_of_neighbours(measured.range_m)
    repaired = np.isnan(measured.range_m) & np.isfinite(filtered)
    return FlashImage(measured, filtered, repaired, triage(measured), frame.stamp_ns)


def sensor_points(image: FlashImage, camera: FlashCamera) -> tuple[F64, F64]:
    """Return the points of `sensor_pixels` and their standard errors."""
    return sensor_pixels(image, camera)[:2]


def sensor_pixels(
    image: FlashImage, camera: FlashCamera, filtered: bool = True
) -> tuple[F64, F64, NDArray[np.bool_]]:
    """Return points (n, 3) forward, left, up of the sensor (m), their standard errors (n,), and their pixels.

    No points are returned where the frame is not usable. A repaired pixel gives no point: nothing was
    measured.

    Parameters
    ----------
    filtered
        True: ranges after the median filter, as in the source; pixels far from the median, false triggers,
        give no point. A median of nine removes objects narrower than two pixels, such as a post. False: the
        measured range of every pixel, for stages with their own outlier removal, as in flight.
    """
    if not image.triage.usable:
        return np.empty((0, 3)), np.empty(0), np.zeros(image.filtered_m.shape, bool)
    sigma = np.nan_to_num(image.measured.sigma_m, nan=camera.sample_m / 12)
    range_m = image.filtered_m if filtered else image.measured.range_m
    keep = np.isfinite(image.measured.range_m)
    if filtered:
        with np.errstate(invalid="ignore"):
            keep = np.abs(image.measured.range_m - range_m) < np.maximum(PARTED_M, PARTED * sigma)
    return range_m[keep, np.newaxis] * _directions(camera)[keep], sigma[keep], keep


@cache
def _directions(camera: FlashCamera) -> F64:
    return camera.directions()


def map_points(points_sensor_m: F64, position_m: F64, T_map_from_sensor: F64) -> F64:
    """Return points in the map frame.

    Parameters
    ----------
    position_m
        (3,), of the sensor in the map.
    T_map_from_sensor
        (3, 3) rotation.

    Raises
    ------
    ValueError
        The pose is not finite, or the matrix is no rotation.
    """
    if not (np.isfinite(position_m).all() and np.isfinite(T_map_from_sensor).all()):
        raise ValueError(f"flash: the pose is not finite: {position_m}, {T_map_from_sensor}")
    if not np.allclose(T_map_from_sensor @ T_map_from_sensor.T, np.eye(3), atol=1e-6):
        raise ValueError(f"flash: T_map_from_sensor is no rotation: {T_map_from_sensor.tolist()}")
    return np.asarray(position_m + points_sensor_m @ T_map_from_sensor.T)  # Flash paper, Eq. (2)
