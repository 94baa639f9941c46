"""Reader of the autopilot's fence, without I/O: its parameters, then its items by the mission protocol.

Read when the autopilot is found, armed or put in the guided mode, when something of the fence changes, and
each half minute. The fence of the last complete reading holds until the next one.

The parameters and their meaning are those of the autopilot's `FenceRules`. A point has to be in all areas of
inclusion, or in any of them if the fence is their union, and in none of exclusion. The point of return is no
boundary.
"""

from __future__ import annotations

import logging
import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from companion.flight.geometry.geofence import NO_FENCE, Boundary, Geofence
from companion.flight.link.autopilots.autopilot_interface import Autopilot, FenceLimits, FenceRules
from companion.flight.link.mission_protocol import FENCE, FenceDownload, FenceItem
from companion.flight.link.parameter_reader import ParameterReader, parameter_value
from companion.flight.link.vehicle_state import VehicleState
from params import Required
from slz import LocalFrame

log = logging.getLogger(__name__)

OWN_MARGIN_M = 2.0  # beyond the autopilot's: overshoot of a stop, and wandering of the estimate
EDGE_DEG, MOST_PARTS = 0.01, 100  # parts of an edge, which bend by centimetres
AGAIN_NS, RETRY_NS = 30_000_000_000, 10_000_000_000
QUIET_NS = 5_000_000_000  # after a transfer of another station
POLYGONS = {
    mavlink.MAV_CMD_NAV_FENCE_POLYGON_VERTEX_INCLUSION: True,
    mavlink.MAV_CMD_NAV_FENCE_POLYGON_VERTEX_EXCLUSION: False,
}
CIRCLES = {
    mavlink.MAV_CMD_NAV_FENCE_CIRCLE_INCLUSION: True,
    mavlink.MAV_CMD_NAV_FENCE_CIRCLE_EXCLUSION: False,
}
# Items with numbers or frames that are none, or too many: no longer the fence read before.
UNUSABLE = frozenset({mavlink.MAV_MISSION_INVALID, mavlink.MAV_MISSION_NO_SPACE})
RETURN_POINT: int = mavlink.MAV_CMD_NAV_FENCE_RETURN_POINT


@dataclass(frozen=True, slots=True)
class Area:
    """Area of a fence: corners in degrees x 1e7, or a circle of a radius around the only one."""

    corners_e7: tuple[tuple[int, int], ...]
    radius_m: float
    inclusion: bool


@dataclass(frozen=True, slots=True)
class AutopilotFence:
    """Fence as the autopilot holds it; heights above home."""

    radius_m: float = math.inf
    lowest_m: float = -math.inf
    highest_m: float = math.inf
    margin_m: float = OWN_MARGIN_M
    is_union: bool = False
    areas: tuple[Area, ...] = ()

    @property
    def needs_home(self) -> bool:
        """True if it is relative to home."""
        return not all(map(math.isinf, (self.radius_m, self.lowest_m, self.highest_m)))

    def geofence(self, frame: LocalFrame, home_lla: tuple[float, float, float] | None) -> Geofence:
        """Return it in a map frame; without a home only the areas."""
        home = None if home_lla is None else frame.enu_m(*home_lla)
        areas = tuple(_boundary(area, frame) for area in self.areas)
        circle = None
        if home is not None and math.isfinite(self.radius_m):
            circle = Boundary(home[None, :2], self.radius_m, True)
        up_m = math.nan if home is None else float(home[2])
        lowest_m = -math.inf if math.isinf(self.lowest_m) or home is None else up_m + self.lowest_m
        highest_m = math.inf if math.isinf(self.highest_m) or home is None else up_m + self.highest_m
        return Geofence(circle, areas, self.is_union, self.margin_m, lowest_m, highest_m)


def areas_of(items: list[FenceItem]) -> tuple[Area, ...]:
    """Return the areas of a fence's items; ValueError if they make none."""
    areas: list[Area] = []
    left = list(items)
    while left:
        item = left[0]
        n_items = 1
        if item.command in POLYGONS:
            n_items = int(item.value)
            corners = left[:n_items]
            same = {(corner.command, corner.value) for corner in corners}
            if n_items < 3 or len(corners) < n_items or len(same) > 1:
                raise ValueError(f"a polygon of {item.value:g} corners has others")
            places = tuple((corner.lat_e7, corner.lon_e7) for corner in corners)
            areas.append(Area(places, 0.0, POLYGONS[item.command]))
        elif item.command in CIRCLES:
            if item.value <= 0:
                raise ValueError(f"a circle has the radius {item.value:g} m")
            areas.append(Area(((item.lat_e7, item.lon_e7),), item.value, CIRCLES[item.command]))
        elif item.command != RETURN_POINT:
            raise ValueError(f"command {item.command} is none of a fence")
        del left[:n_items]
    return tuple(areas)


class FenceReader:
    """Reads the fence, and gives it in the map frame."""

    def __init__(self) -> None:
        self._identity: tuple[int | None, Autopilot, int] | None = None
        self._steps = (False, False)
        self._reader: ParameterReader | None = None
        self._download: FenceDownload | None = None
        self._values: dict[str, float] | None = None
        self._areas: tuple[Area, ...] = ()
        self._areas_known = False
        self._fault = ""
        self._is_read = False
        self._due_ns = 0
        self._again_ns: int | None = None  # time to read because something changed
        self._cache: tuple[tuple[object, ...], Geofence] | None = None

    @property
    def is_read(self) -> bool:
        """True if a reading has ended since the vehicle was found, well or not."""
        return self._is_read

    @property
    def busy(self) -> bool:
        """True if items are being downloaded."""
        return self._download is not None

    def is_known(self, vehicle: VehicleState) -> bool:
        """Return whether the whole fence of the vehicle is known, or that it has none."""
        fence = self.fence(vehicle)
        if fence is None:
            return False
        return not fence.needs_home or vehicle.home_lla is not None

    def fence(self, vehicle: VehicleState) -> AutopilotFence | None:
        """Return the fence as last read, None as long as a part of it is unknown."""
        return None if self._has_unread_areas(vehicle) else self._known_part(vehicle)

    def geofence(self, vehicle: VehicleState, frame: LocalFrame | None) -> Geofence:
        """Return the fence in a map frame, as far as it is known."""
        part = self._known_part(vehicle)
        if part is None or frame is None:
            return NO_FENCE
        key = (part, frame, vehicle.home_lla)
        if self._cache is None or self._cache[0] != key:
            self._cache = key, part.geofence(frame, vehicle.home_lla)
        return self._cache[1]

    # ---- messages -------------------------------------------------------------------------------

    def poll(
        self, now_ns: int, vehicle: VehicleState, connected: bool, us: tuple[int, int], *, quiet: bool
    ) -> list[Any]:
        """Return the requests to send now; quiet: no other transfer of the mission protocol is under way."""
        self._follow(vehicle, connected)
        rules = vehicle.autopilot.fence
        if vehicle.sysid is None or not connected or rules is None:
            return []
        if self._download is not None:
            out = self._download.poll(now_ns)
            self._finish(now_ns)
            return out
        if self._reader is None and self._is_due(now_ns):
            rows = tuple(map(_row, (*rules.needed, *rules.versions)))
            self._reader = ParameterReader(rows, vehicle.autopilot)
            self._again_ns = None
        if self._reader is None:
            return []
        out = self._reader.due(vehicle.sysid, now_ns)
        if not out and self._reader.done and quiet:
            self._download = FenceDownload(vehicle.sysid, *us)
            out = self._download.poll(now_ns)
        return out

    def on_parameter(self, message: Any) -> None:
        """Process a PARAM_VALUE or PARAM_ERROR, requested or not."""
        if self._reader is not None:
            self._reader.on_message(message)
        elif message.get_type() == "PARAM_VALUE" and self._identity is not None:
            before = (self._values or {}).get(str(message.param_id).rstrip("\0"))
            bytewise = self._identity[1].bytewise_parameters
            if before is not None and before != parameter_value(message, bytewise):
                self._due_ns = 0

    def on_mission(self, message: Any, now_ns: int, vehicle: int, us: tuple[int, int]) -> list[Any]:
        """Process a message of the mission protocol from any sender, and return the answers."""
        sender = (message.get_srcSystem(), message.get_srcComponent())
        if getattr(message, "mission_type", 0) != FENCE:
            return []
        if (message.target_system, message.target_component) != us:
            if vehicle in (sender[0], message.target_system):
                self._again_ns = now_ns + QUIET_NS  # somebody else reads or writes it
            return []
        if self._download is None or sender != (vehicle, mavlink.MAV_COMP_ID_AUTOPILOT1):
            return []
        out = self._download.on_message(message, now_ns)
        self._finish(now_ns)
        return out

    # ---- details --------------------------------------------------------------------------------

    @property
    def _rules(self) -> FenceRules | None:
        return None if self._identity is None else self._identity[1].fence

    def _follow(self, vehicle: VehicleState, connected: bool) -> None:
        """Forget the fence of another vehicle, and read again at each hand-over."""
        identity = (vehicle.sysid, vehicle.autopilot, vehicle.reboots)
        if identity != self._identity:
            self._identity = identity
            self._reader = self._download = self._values = None
            self._areas, self._areas_known = (), False
            self._due_ns, self._again_ns, self._is_read = 0, None, False
        steps = (vehicle.armed and connected, vehicle.guided and connected)
        if any(new and not old for new, old in zip(steps, self._steps, strict=True)):
            self._due_ns = 0
        self._steps = steps

    def _is_due(self, now_ns: int) -> bool:
        return now_ns >= self._due_ns or (self._again_ns is not None and now_ns >= self._again_ns)

    def _finish(self, now_ns: int) -> None:
        """Use a finished download, with the parameters read before it."""
        download, reader, rules = self._download, self._reader, self._rules
        if download is None or reader is None or download.outcome is None or rules is None:
            return
        self._download = self._reader = None
        self._is_read = True
        has_none = download.refusal == mavlink.MAV_MISSION_UNSUPPORTED
        fault = "" if download.outcome == "done" or has_none else f"items: {download.outcome}"
        if not fault:
            try:
                self._areas, self._areas_known = areas_of(download.items), True
            except ValueError as error:  # the ones before are kept, though they are no longer true
                self._areas_known, fault = False, str(error)
        elif download.refusal in UNUSABLE:
            self._areas_known = False
        values = self._complete(reader, rules, has_none)
        if values is None:
            fault = fault or "parameters: no answer"
        else:
            self._values = values
        if fault and fault != self._fault:
            log.warning("the autopilot's fence could not be read: %s", fault)
        self._fault = fault
        self._due_ns = now_ns + (RETRY_NS if fault else AGAIN_NS)

    def _complete(
        self, reader: ParameterReader, rules: FenceRules, has_none: bool
    ) -> dict[str, float] | None:
        """Return the values of a reading, empty for an autopilot without a fence; None if one is missing.

        One that some versions lack keeps its value of before while it is not answered.
        """
        needed, versions = rules.needed, rules.versions
        if not needed or needed[0] in reader.absent or (has_none and needed[0] not in reader.values):
            return {}
        if any(name not in reader.values for name in needed):
            return None
        read = {name: reader.values[name] for name in (*needed, *versions) if name in reader.values}
        return {**versions, **(self._values or {}), **read}

    def _has_unread_areas(self, vehicle: VehicleState) -> bool:
        if self._values is None:
            return True
        limits = self._limits(vehicle)
        return limits is not None and limits.has_areas and not self._areas_known

    def _known_part(self, vehicle: VehicleState) -> AutopilotFence | None:
        if self._values is None:
            return None
        limits = self._limits(vehicle)
        if limits is None:
            return AutopilotFence()
        height_margin_m = limits.height_margin_m + OWN_MARGIN_M
        return AutopilotFence(
            radius_m=limits.radius_m,
            lowest_m=limits.lowest_m + height_margin_m,
            highest_m=limits.highest_m - height_margin_m,
            margin_m=limits.margin_m + OWN_MARGIN_M,
            is_union=limits.is_union,
            areas=self._areas if limits.has_areas else (),
        )

    def _limits(self, vehicle: VehicleState) -> FenceLimits | None:
        """Return the limits by the parameters last read; None without a fence, or while it does not act."""
        rules = self._rules
        return rules.limits(self._values, vehicle.health.fenced) if self._values and rules else None


def _row(name: str) -> Required:
    return Required(name, 0.0, (), "wanted", "")


def _boundary(area: Area, frame: LocalFrame) -> Boundary:
    corners_deg = np.array(area.corners_e7, np.float64) * 1e-7
    lat, lon = (corners_deg if area.radius_m else _along_edges(corners_deg)).T
    return Boundary(
        frame.enu_m(lat, lon, np.full(len(lat), frame.alt_m))[:, :2], area.radius_m, area.inclusion
    )


def _along_edges(corners_deg: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the corners (n, 2) of a polygon, and points between those far apart, latitude and longitude.

    Both autopilots draw edges straight in degrees: one of 20 km to the east bends by 8 m in the map frame.
    """
    ways = np.roll(corners_deg, -1, axis=0) - corners_deg
    ways[:, 1] = (ways[:, 1] + 180) % 360 - 180
    counts = np.clip(np.ceil(np.abs(ways).max(axis=1) / EDGE_DEG), 1, MOST_PARTS).astype(int)
    return np.concatenate(
        [
            corner + way * np.arange(count)[:, None] / count
            for corner, way, count in zip(corners_deg, ways, counts, strict=True)
        ]
    )
