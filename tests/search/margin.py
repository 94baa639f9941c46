"""Margin of a flight to an unsafe touchdown, from the simulator's exact truth; below zero is unsafe.

Each part is the share of its allowance that is left: 1 is all of it, 0 the limit, -1 at least as far beyond.
The margin is the least. What shows beside it how well the flight answered what happened, though nothing is
unsafe yet, is its response: a search by the margin alone ends at what is tall and near, where every flight
has little left.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from scipy.ndimage import distance_transform_edt

from sitl.simulation import Simulation
from sitl.truth.touchdown import TIP_LIMIT_DEG, footing
from sitl.truth.truth import safe_map
from sitl.vehicle.multirotor import HARDEST_TOUCH_MS
from sitl.world.primitives import Box, Ellipsoid
from tests.search.hazard import Hazard
from tests.search.troubles import Spell

SLOPE_DEG, RELIEF_M = 10.0, 0.3  # of `safe_map`
RESPONSE_S = 3.0  # after what came has come
RESPONSE_WEIGHT = 0.5
CELL_M, AROUND_CELLS = 0.2, 12
PLACE_M, HAZARD_M = 2.4, 10.0  # distances that count as all of the allowance
STRUCK = -0.5
BODY_RADIUS_M, BODY_HEIGHT_M = 0.45, 0.3  # the rotors' disc and what is below it
LOOK_NS = 40_000_000


class HazardClearance:
    """Hook of `Simulation.every_tick`: least distance of the vehicle to a hazard, until the touchdown.

    Attributes
    ----------
    least_m
        Infinite before the hazard comes; negative inside it.
    """

    def __init__(self, hazard: Hazard | None) -> None:
        self._hazard = hazard
        self._next_ns = 0
        self.least_m = math.inf

    def __call__(self, simulation: Simulation) -> None:
        if self._hazard is None or self._hazard.started_ns is None or simulation.now_ns < self._next_ns:
            return
        if simulation.touchdown is None and simulation.vehicle.collision is None:
            self._next_ns = simulation.now_ns + LOOK_NS
            self.least_m = min(self.least_m, self._now_m(simulation))

    def _now_m(self, simulation: Simulation) -> float:
        mover = simulation.scene.world.movers[Hazard.what]
        place = simulation.vehicle.truth.pos_enu_m
        return min(clearance_m(place, part) for part in mover.placed())


def clearance_m(feet_enu_m: Any, part: Box | Ellipsoid) -> float:
    """Return the distance between the vehicle, an upright cylinder, and the box about a part of a hazard."""
    x0, y0, z0, x1, y1, z1 = part.bounds()
    east, north, up = (float(v) for v in feet_enu_m)
    if isinstance(part, Ellipsoid):
        aside = math.hypot(east - part.x_m, north - part.y_m) - part.radius_x_m - BODY_RADIUS_M
    else:
        dx, dy = max(x0 - east, east - x1), max(y0 - north, north - y1)
        inside = max(dx, dy) if max(dx, dy) < 0 else math.hypot(max(dx, 0.0), max(dy, 0.0))
        aside = inside - BODY_RADIUS_M
    above = max(up - z1, z0 - up - BODY_HEIGHT_M)
    if aside < 0 and above < 0:
        return max(aside, above)
    return math.hypot(max(aside, 0.0), max(above, 0.0))


def parts_of(simulation: Simulation, clearance: HazardClearance) -> dict[str, float]:
    """Return the parts of the margin of a flight that is over, by name."""
    parts = {"hazard": min(1.0, clearance.least_m / HAZARD_M)}
    struck, touchdown = simulation.vehicle.collision, simulation.touchdown
    if struck is not None:
        parts["collision"] = STRUCK - min(0.5, struck["speed_ms"] / 20.0)
    if touchdown is not None:
        parts |= _touchdown_parts(simulation, touchdown)
    return {name: round(max(-1.0, value), 5) for name, value in parts.items()}


def _touchdown_parts(simulation: Simulation, touchdown: dict[str, Any]) -> dict[str, float]:
    world, e, n = simulation.scene.world, touchdown["e"], touchdown["n"]
    half = (AROUND_CELLS + 0.5) * CELL_M
    ground = safe_map(world, (e - half, n - half, e + half, n + half), CELL_M)
    centre = AROUND_CELLS, AROUND_CELLS
    safe = ground.safe.astype(bool)
    stands = footing(world, touchdown, simulation.log.gear, TIP_LIMIT_DEG)
    tilt = -1.0 if stands.tilt_deg is None else 1.0 - stands.tilt_deg / TIP_LIMIT_DEG
    speed_ms = math.hypot(touchdown["sink_ms"], touchdown["drift_ms"])
    return {
        "place": min(1.0, _signed_m(safe) / PLACE_M),
        "slope": 1.0 - float(np.nan_to_num(ground.slope_deg[centre], nan=90.0)) / SLOPE_DEG,
        "relief": 1.0 - float(np.nan_to_num(ground.relief_m[centre], nan=10.0)) / RELIEF_M,
        "gear": min(tilt, -0.1) if stands.belly_touches else tilt,
        "speed": 1.0 - speed_ms / HARDEST_TOUCH_MS,
    }


def _signed_m(safe: Any) -> float:
    """Return the distance of the middle cell to unsafe cells, or minus that to safe ones."""
    centre = AROUND_CELLS, AROUND_CELLS
    is_safe = bool(safe[centre])
    others = ~safe if is_safe else safe
    if not others.any():
        return math.inf if is_safe else -AROUND_CELLS * CELL_M
    away_m = (float(distance_transform_edt(~others)[centre]) - 0.5) * CELL_M
    return away_m if is_safe else -away_m


def response_of(
    simulation: Simulation,
    hazard: Hazard | None,
    silence: Spell | None,
    reacted_ns: int | None,
    missed: tuple[float, float] | None,
) -> dict[str, float]:
    """Return the parts of the response to what happened, by name.

    missed: of `missed_m_deg`.

    reaction: time from the arrival of a hazard that is in the way to when the landing was broken off or
    waited, below zero while it was still coming; absent if neither was. silence: time from when the LiDAR
    fell silent to that, if it was before the end of the silence. accuracy: distance of the touchdown from the
    ordered point, as the autopilot knew it.
    """
    parts = {}
    late_ns = None if hazard is None or reacted_ns is None else hazard.late_ns(reacted_ns)
    if late_ns is not None:
        parts["reaction"] = _left(late_ns)
    if silence is not None and silence.begun_ns is not None and reacted_ns is not None:
        late_ns = reacted_ns - silence.begun_ns
        if 0 <= late_ns <= silence.lasts_ns:
            parts["silence"] = _left(late_ns)
    if missed is not None:
        parts["accuracy"] = round(max(-1.0, 1.0 - missed[0] / PLACE_M), 5)
    return parts


def missed_m_deg(simulation: Simulation, ordered_en_m: tuple[float, float]) -> tuple[float, float] | None:
    """Return distance and compass bearing from the ordered point to the touchdown, as the autopilot knew."""
    if (touchdown := simulation.touchdown) is None:
        return None
    known, true = simulation.autopilot.estimate, simulation.vehicle.truth
    drift = (0.0, 0.0) if known is None else known.pos_enu_m[:2] - true.pos_enu_m[:2]
    east = touchdown["e"] + float(drift[0]) - ordered_en_m[0]
    north = touchdown["n"] + float(drift[1]) - ordered_en_m[1]
    return round(math.hypot(east, north), 4), round(math.degrees(math.atan2(east, north)) % 360.0, 4)


def _left(late_ns: int) -> float:
    return round(max(-1.0, 1.0 - late_ns * 1e-9 / RESPONSE_S), 5)


def margin_of(parts: dict[str, float]) -> float:
    """Return the margin, the least of the parts."""
    return min(parts.values())


def score_of(parts: dict[str, float], response: dict[str, float]) -> float:
    """Return what the search minimises: margin, response, and a little of what the other parts say."""
    answered = RESPONSE_WEIGHT * min(response.values(), default=1.0)
    return margin_of(parts) + answered + 0.1 * sum(parts.values()) / len(parts)
