"""Landing gear: where it touches the ground at each heading, and its limits."""

from __future__ import annotations

import functools
import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from params import Parameters
from slz.kernels.footprint.rest_pose import A_PAD, GearLimits

HEADING_STEP_DEG = 15
HEADING_ERROR_DEG = 10.0  # by which a landing vehicle may miss a heading, see companion.flight.landing
MOST_OF_A_SKID = 16  # contacts
Place = tuple[float, float]  # forward and right of the centre of gravity, m


@dataclass(frozen=True, slots=True, eq=False)
class Gear:
    """Landing gear on a terrain map.

    contacts_m: (headings, contacts, 2) east and north of the contacts from the centre of gravity; no headings
    for no gear. period_deg: turned by it, the gear is the same, so headings beyond it are left out. limits:
    see `slz.kernels.footprint.rest_pose`.
    """

    contacts_m: NDArray[np.float32]
    period_deg: int
    limits: GearLimits

    @property
    def reach_m(self) -> float:
        """Distance from the centre of gravity within which it touches the ground at any heading."""
        if not len(self.contacts_m):
            return 0.0
        return float(np.linalg.norm(self.contacts_m[0], axis=1).max()) + self.limits[A_PAD]


NO_GEAR = Gear(np.empty((0, 3, 2), np.float32), 360, (1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0))


@functools.lru_cache(maxsize=8)
def gear_of(parameters: Parameters, cell_m: float) -> Gear:
    """Return the gear for cells of a size."""
    if parameters.gear == "none":
        return NO_GEAR
    p, (length_m, width_m) = parameters, parameters.gear_size_m
    line, places, period_deg = _contacts(p.gear, length_m, width_m, cell_m)
    headings = np.radians(np.arange(0, period_deg, HEADING_STEP_DEG))
    forward, right = np.array(places).T
    sine, cosine = np.sin(headings)[:, None], np.cos(headings)[:, None]
    contacts = np.stack([forward * sine + right * cosine, forward * cosine - right * sine], axis=2)
    tip, slope = math.radians(p.greatest_tilt_deg), math.radians(p.safe_slope_deg)
    limits = (
        float(line), math.tan(tip), p.clearance_m, math.hypot(length_m, width_m) / 2,
        p.pad_radius_m, _leverage_per_m(p.gear, length_m, width_m),
        math.tan(slope) / p.safe_slope_deg,
    )  # fmt: skip
    return Gear(contacts.astype(np.float32), period_deg, limits)


def _contacts(kind: str, length_m: float, width_m: float, cell_m: float) -> tuple[int, list[Place], int]:
    """Return how many contacts a line has, the contacts at heading 0 line by line, and the period."""
    ahead, aside = length_m / 2, width_m / 2
    if kind == "skids":
        count = min(MOST_OF_A_SKID, max(3, math.ceil(length_m / cell_m) + 1))
        along = np.linspace(-ahead, ahead, count).tolist()
        return count, [(x, y) for y in (-aside, aside) for x in along], 180
    if kind == "tripod":
        return 1, [(ahead, 0.0), (-ahead, -aside), (-ahead, aside)], 360
    square = length_m == width_m
    return 1, [(x, y) for x in (ahead, -ahead) for y in (-aside, aside)], 90 if square else 180


def _leverage_per_m(kind: str, length_m: float, width_m: float) -> float:
    """Return the greatest gradient by which the gear can tilt on ground within a relief of 1 m.

    Pads: four pads rest on three corners of a rectangle, which rise by 1 m along both sides at most; a tripod
    rests on its three. Skids: the plane is at most 1 m above the lowest ground below the centre, and not
    below it at the skid towards which it falls, half the length or width away.
    """
    ahead, aside = length_m / 2, width_m / 2
    if kind == "skids":
        return 1 / min(ahead, aside)
    if kind == "tripod":
        return max(1 / (2 * ahead), math.hypot(1 / (4 * ahead), 1 / (2 * aside)))
    return math.hypot(1 / (2 * ahead), 1 / (2 * aside))
