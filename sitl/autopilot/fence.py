"""Geofence: circle around home, ceiling, floor and areas, like ArduCopter's AC_Fence and AC_Avoid.

Velocities of the guided mode stop at the margin without a word, and nothing refuses them; beyond a boundary
the failsafe acts.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from sitl.autopilot.mission_items import Item, MissionItems, place_fault

F64 = NDArray[np.float64]

CEILING, CIRCLE, AREAS, FLOOR = 1, 2, 4, 8
NAMES = {CEILING: "Max Alt", CIRCLE: "Circle", AREAS: "Polygon", FLOOR: "Min Alt"}
UNION = 2  # bit of FENCE_OPTIONS
RECOVERY_NS = 10_000_000_000
BRAKING_MS2, REACTION_S, BACK_MS = 1.0, 1.0, 0.75

VERTICES = {
    mavlink.MAV_CMD_NAV_FENCE_POLYGON_VERTEX_INCLUSION: True,
    mavlink.MAV_CMD_NAV_FENCE_POLYGON_VERTEX_EXCLUSION: False,
}
CIRCLES = {
    mavlink.MAV_CMD_NAV_FENCE_CIRCLE_INCLUSION: True,
    mavlink.MAV_CMD_NAV_FENCE_CIRCLE_EXCLUSION: False,
}
RETURN_POINT = mavlink.MAV_CMD_NAV_FENCE_RETURN_POINT


@dataclass(frozen=True, slots=True, eq=False)
class Area:
    """Polygon, or circle around the only corner: the vehicle stays inside an inclusion, else outside."""

    corners_m: F64
    radius_m: float
    inclusion: bool

    def nearest(self, place_m: F64) -> tuple[float, F64]:
        """Return the distance to the edge, negative on the forbidden side, and the direction (2,) to it."""
        if self.radius_m:
            offset = place_m - self.corners_m[0]
            away_m = float(np.hypot(*offset))
            outward = offset / away_m if away_m > 0 else np.array([1.0, 0.0])
            inside_m = self.radius_m - away_m
            to_edge = outward if inside_m > 0 else -outward
        else:
            inside_m, to_edge = _to_polygon(self.corners_m, place_m)
        return (inside_m if self.inclusion else -inside_m), to_edge


class FenceItems(MissionItems):
    """Items of the fence; they replace the ones before when all have arrived and make areas."""

    kind, room, total = mavlink.MAV_MISSION_TYPE_FENCE, 255, "FENCE_TOTAL"
    replaces_at_end = True

    def areas(self) -> list[Area]:
        """Return the areas in the estimate's frame."""
        return [
            Area(np.array([self._place(one) for one in group]), radius_m, inclusion)
            for group, radius_m, inclusion in _grouped(self.items)
        ]

    def _place(self, item: Item) -> F64:
        return self._ap.enu_m(item.lat_e7 * 1e-7, item.lon_e7 * 1e-7, self._ap.origin_lla[2])[:2]

    def _fault(self, message: Any) -> int:
        if message.command not in {*VERTICES, *CIRCLES, RETURN_POINT}:
            return int(mavlink.MAV_MISSION_UNSUPPORTED)
        if not 0 <= message.param1 < 1e6:
            return int(mavlink.MAV_MISSION_INVALID_PARAM1)
        return place_fault(message)

    def _are_valid(self, items: list[Item]) -> bool:
        try:
            return bool(list(_grouped(items)))
        except ValueError:
            return False


@dataclass(slots=True)
class Fence:
    """Fences selected by FENCE_TYPE's bits, and their breaches.

    Attributes
    ----------
    items
        Its areas.
    on_floor
        Whether the floor counts: from the first time above it, and not in a landing.
    """

    parameters: dict[str, float]
    items: FenceItems
    breached: int = 0
    count: int = 0
    breach_boot_ms: int = 0
    recovery_until_ns: int = 0
    on_floor: bool = False
    _areas: tuple[list[Item], list[Area]] = field(default_factory=lambda: ([], []))

    @property
    def kinds(self) -> int:
        """Bits of the fences that are configured and present."""
        return int(self.parameters["FENCE_TYPE"]) & ~(0 if self.items.items else AREAS)

    @property
    def enabled(self) -> bool:
        """True if any fence is active."""
        p = self.parameters
        return bool((p["FENCE_ENABLE"] or p["FENCE_AUTOENABLE"]) and self.kinds)

    def check(self, position_enu_m: F64, home_enu_m: F64, now_ns: int, boot_ms: int, *, landing: bool) -> int:
        """Check the position; return the bits of the fences left since the last call."""
        if not self.enabled:
            self.breached = 0
            return 0
        up_m = float(position_enu_m[2] - home_enu_m[2])
        above = up_m >= self.parameters["FENCE_ALT_MIN"] + self.parameters["FENCE_MARGIN"]
        self.on_floor = not landing and (self.on_floor or above)
        if now_ns < self.recovery_until_ns:
            return 0
        outside = self._outside(position_enu_m, home_enu_m)
        new = outside & ~self.breached
        if new:
            self.count += 1
            self.breach_boot_ms = boot_ms
        self.breached = outside
        return new

    def recover(self, now_ns: int) -> None:
        """Suspend the checks for ten seconds after a change of mode outside the fence."""
        if self.breached:
            self.recovery_until_ns = now_ns + RECOVERY_NS

    def limited(self, velocity_enu_ms: F64, position_enu_m: F64, home_enu_m: F64) -> F64:
        """Return a velocity (3,) that stops at the margin of each fence, and backs away from it."""
        if not self.enabled or not velocity_enu_ms.any():
            return velocity_enu_ms
        p, out = self.parameters, velocity_enu_ms.copy()
        margin_m = p["FENCE_MARGIN_XY"] or p["FENCE_MARGIN"]
        up_m = float(position_enu_m[2] - home_enu_m[2])
        if out[2] and self.kinds & CEILING:
            out[2] = min(float(out[2]), _fastest_ms(p["FENCE_ALT_MAX"] - p["FENCE_MARGIN"] - up_m))
        if out[2] and self.kinds & FLOOR and self.on_floor:
            out[2] = max(float(out[2]), -_fastest_ms(up_m - p["FENCE_ALT_MIN"] - p["FENCE_MARGIN"]))
        for room_m, to_edge in self._edges(position_enu_m, home_enu_m):
            if room_m < 0:
                continue  # already beyond it: no limit
            excess = float(out[:2] @ to_edge) - _fastest_ms(room_m - margin_m)
            if excess > 0:
                out[:2] -= excess * to_edge
        return out

    def _edges(self, position_enu_m: F64, home_enu_m: F64) -> Iterator[tuple[float, F64]]:
        """Yield the room before each horizontal boundary, negative beyond it, and the direction to it."""
        if self.kinds & CIRCLE:
            circle = Area(home_enu_m[None, :2], self.parameters["FENCE_RADIUS"], True)
            yield circle.nearest(position_enu_m[:2])
        if self.kinds & AREAS:
            for area in self._known_areas():
                yield area.nearest(position_enu_m[:2])

    def _known_areas(self) -> list[Area]:
        if self._areas[0] is not self.items.items:
            self._areas = self.items.items, self.items.areas()
        return self._areas[1]

    def _outside(self, position_enu_m: F64, home_enu_m: F64) -> int:
        p = self.parameters
        east, north, up = (float(v) for v in position_enu_m - home_enu_m)
        outside = CEILING if up >= p["FENCE_ALT_MAX"] else 0
        outside |= FLOOR if self.on_floor and up <= p["FENCE_ALT_MIN"] else 0
        outside |= CIRCLE if math.hypot(east, north) >= p["FENCE_RADIUS"] else 0
        if self.kinds & AREAS:
            outside |= AREAS if self._is_out_of_areas(position_enu_m[:2]) else 0
        return outside & self.kinds

    def distance_beyond_m(self, kinds: int, position_enu_m: F64, home_enu_m: F64) -> float:
        """Return the greatest distance by which the position is beyond fences of some kinds."""
        p, up_m = self.parameters, float(position_enu_m[2] - home_enu_m[2])
        beyond = [-room_m for room_m, _ in self._edges(position_enu_m, home_enu_m)]
        beyond += [up_m - p["FENCE_ALT_MAX"]] if kinds & CEILING else []
        beyond += [p["FENCE_ALT_MIN"] - up_m] if kinds & FLOOR else []
        return max(beyond, default=0.0)

    def _is_out_of_areas(self, place_m: F64) -> bool:
        out = [(area.inclusion, area.nearest(place_m)[0] < 0) for area in self._known_areas()]
        left = [is_out for inclusion, is_out in out if inclusion]
        union = int(self.parameters["FENCE_OPTIONS"]) & UNION
        return bool(left and (all if union else any)(left)) or any(
            is_out for inclusion, is_out in out if not inclusion
        )

    def status(self) -> mavlink.MAVLink_fence_status_message:
        """Return FENCE_STATUS."""
        kind = mavlink.FENCE_BREACH_MINALT if self.breached & FLOOR else mavlink.FENCE_BREACH_NONE
        kind = mavlink.FENCE_BREACH_MAXALT if self.breached & CEILING else kind
        kind = mavlink.FENCE_BREACH_BOUNDARY if self.breached & (CIRCLE | AREAS) else kind
        return mavlink.MAVLink_fence_status_message(
            int(self.breached != 0), self.count, kind, self.breach_boot_ms
        )


def names(bits: int) -> str:
    """Return the names of fences as in ArduCopter's texts."""
    return " and ".join(name for bit, name in NAMES.items() if bits & bit)


def _grouped(items: list[Item]) -> Iterator[tuple[list[Item], float, bool]]:
    """Yield the items of each area, its radius (0 for a polygon) and its kind; ValueError for none."""
    at = 0
    while at < len(items):
        first = items[at]
        if first.command in VERTICES:
            group = items[at : at + int(first.value)]
            if len(group) < max(3, int(first.value)) or len({(i.command, i.value) for i in group}) != 1:
                raise ValueError("a polygon lacks corners")
            yield group, 0.0, VERTICES[first.command]
            at += len(group)
            continue
        if first.command in CIRCLES:
            yield [first], first.value, CIRCLES[first.command]
        at += 1


def _to_polygon(corners_m: F64, place_m: F64) -> tuple[float, F64]:
    """Return the distance to a polygon's edge, negative outside, and the direction (2,) to it."""
    best_m, to_edge, inside = math.inf, np.array([1.0, 0.0]), False
    for start, end in zip(corners_m, np.roll(corners_m, -1, axis=0), strict=True):
        edge = end - start
        share = min(1.0, max(0.0, float((place_m - start) @ edge) / max(1e-9, float(edge @ edge))))
        offset = start + share * edge - place_m
        away_m = float(np.hypot(*offset))
        if away_m < best_m:
            best_m, to_edge = away_m, offset / max(1e-9, away_m)
        if (start[1] > place_m[1]) != (end[1] > place_m[1]):
            east = start[0] + (place_m[1] - start[1]) / edge[1] * edge[0]
            inside ^= bool(place_m[0] < east)
    return (best_m if inside else -best_m), to_edge


def _fastest_ms(room_m: float) -> float:
    """Return the speed towards a margin: one that can be braked before it, or away from it beyond it."""
    if room_m <= 0:
        return -min(BACK_MS, -room_m)
    slow_ms = BRAKING_MS2 * REACTION_S
    return math.sqrt(slow_ms**2 + 2 * BRAKING_MS2 * room_m) - slow_ms
