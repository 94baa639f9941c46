"""Rally points of the autopilot at the best zones, so that its own RTL lands on mapped ground.

RTL flies to the nearest of rally points and home, also when this program is dead. Therefore only zones of the
near map that are certain enough are uploaded, or of the survey prior while there is none. They are removed
when the vehicle is disarmed, lest the next flight return to where cars stand by then. The pilot's own points
are kept.
"""

from __future__ import annotations

import logging
import math
from collections.abc import Iterable
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from companion.flight.geometry.geofence import NO_FENCE, Geofence
from companion.flight.link.mission_protocol import HIGHEST_M, RallyDownload, RallyPoint, Transfer, Upload
from companion.flight.link.vehicle_state import VehicleState
from params import Parameters
from slz import Report, Zone

log = logging.getLogger(__name__)

MOST = 5
LIMIT_M = 300.0  # RALLY_LIMIT_KM: ArduPilot ignores points farther away
CHANGED_M = 2.0
# Pause between two of our transfers; after one of another station; between checks for changes by others.
PAUSE_NS = 10_000_000_000
QUIET_NS = 5_000_000_000
LOOK_NS = 60_000_000_000
LONGEST_PAUSE_NS = 80_000_000_000
METRES_PER_E7 = 0.0111319
HALF_ROUND_E7 = 1_800_000_000
# The autopilot may return a coordinate with different rounding.
SAME_E7 = 2
TRANSFERS = frozenset(
    {
        "MISSION_COUNT", "MISSION_REQUEST", "MISSION_REQUEST_INT", "MISSION_REQUEST_LIST", "MISSION_ITEM",
        "MISSION_ITEM_INT", "MISSION_ACK", "MISSION_CLEAR_ALL", "MISSION_WRITE_PARTIAL_LIST",
    }
)  # fmt: skip


def best_points(
    report: Report, vehicle: VehicleState, parameters: Parameters, fence: Geofence = NO_FENCE
) -> tuple[RallyPoint, ...]:
    """Return the rally points of a report: its best near zones, certain, within reach and inside the fence.

    Without such a zone, the zones of the survey prior are used. Zones that need a confirmation are left out:
    nobody is asked when the autopilot returns.
    """
    if vehicle.position_lla is None or vehicle.relative_alt_m is None:
        return ()
    lat, lon, alt = vehicle.position_lla
    here = (round(lat * 1e7), round(lon * 1e7))
    home_m = alt - vehicle.relative_alt_m
    inside = [zone for zone in report.near.zones if fence.holds(zone.best.enu_m)]
    found = _points(report, inside, parameters.min_certainty, here, home_m, parameters)
    if not found and report.prior is not None:
        inside = [zone for zone in report.prior.zones if fence.holds(zone.best.enu_m)]
        found = _points(report, inside, 0.0, here, home_m, parameters)
    return found


def _points(
    report: Report,
    zones: Iterable[Zone],
    least_certainty: float,
    here: tuple[int, int],
    home_m: float,
    parameters: Parameters,
) -> tuple[RallyPoint, ...]:
    points: list[RallyPoint] = []
    for zone in zones:
        best = zone.best
        if best.has_no_heading or best.certainty < least_certainty or not all(map(math.isfinite, best.enu_m)):
            continue
        if best.surface.must_be_confirmed(parameters.roof, parameters.vegetation):
            continue
        there = [float(v) for v in report.frame.lla(best.enu_m)]
        above_home_m = math.ceil(there[2] - home_m + parameters.rally_height_m - 0.01)
        point = RallyPoint(round(there[0] * 1e7), round(there[1] * 1e7), max(-HIGHEST_M, above_home_m))
        if apart_m(point, *here) <= LIMIT_M:
            points.append(point)
        if len(points) == MOST:
            break
    return tuple(points)


def apart_m(point: RallyPoint, lat_e7: int, lon_e7: int) -> float:
    """Return the horizontal distance in m, accurate to a percent over kilometres."""
    # The shorter way round, also across the date line.
    turn_e7 = (point.lon_e7 - lon_e7 + HALF_ROUND_E7) % (2 * HALF_ROUND_E7) - HALF_ROUND_E7
    east = turn_e7 * METRES_PER_E7 * math.cos(math.radians(lat_e7 * 1e-7))
    return math.hypot((point.lat_e7 - lat_e7) * METRES_PER_E7, east)


def moved(old: tuple[RallyPoint, ...], new: tuple[RallyPoint, ...]) -> bool:
    """Return whether points differ enough to be worth a transfer."""

    def near(a: RallyPoint, b: RallyPoint) -> bool:
        return apart_m(a, b.lat_e7, b.lon_e7) <= CHANGED_M and abs(a.alt_m - b.alt_m) <= CHANGED_M

    return len(old) != len(new) or any(not any(near(a, b) for b in old) for a in new)


class Rally:
    """Keeps our rally points on the vehicle beside those of others.

    Parameters
    ----------
    ours
        Our points that an earlier run may have left on the vehicle.

    Attributes
    ----------
    ours
        Our points that may be on the vehicle, to be stored for the next start.
    foreign
        Points of others on the vehicle at the last download.
    uploads, failures
        Counts of uploads and of failed transfers.
    """

    def __init__(self, ours: Iterable[RallyPoint] = ()) -> None:
        self.ours: tuple[RallyPoint, ...] = tuple(ours)
        self.foreign: tuple[RallyPoint, ...] = ()
        self.uploads = 0
        self.failures = 0
        self._there: tuple[RallyPoint, ...] | None = None  # our points that are on the vehicle for certain
        self._goal: tuple[RallyPoint, ...] = ()
        self._owed: tuple[RallyPoint, ...] = ()  # points of others that a failed upload may have removed
        self._transfer: Transfer | None = None
        self._next_ns = 0
        self._look_ns = 0
        self._others_ns: int | None = None
        self._pause_ns = PAUSE_NS

    @property
    def busy(self) -> bool:
        """True if a transfer is in progress."""
        return self._transfer is not None

    def is_quiet(self, now_ns: int) -> bool:
        """Return whether neither this nor, as far as heard, another station transfers anything."""
        return not self.busy and not self._others_are_at_it(now_ns)

    def poll(
        self, now_ns: int, wanted: tuple[RallyPoint, ...] | None, vehicle: int, us: tuple[int, int]
    ) -> list[Any]:
        """Return the messages to send now.

        Parameters
        ----------
        wanted
            Points that should be on the vehicle; None leaves them unchanged.
        vehicle, us
            The vehicle's system; our system and component.
        """
        if self._transfer is None:
            if wanted is None or not self._calls_for(wanted, now_ns):
                return []
            self._goal = wanted
            self._transfer = RallyDownload(vehicle, *us)
        out = self._transfer.poll(now_ns)
        return out + self._go_on(now_ns, vehicle, us)

    def on_message(self, message: Any, now_ns: int, vehicle: int, us: tuple[int, int]) -> list[Any]:
        """Process a message of the mission protocol from any sender, and return the answers."""
        if message.get_type() not in TRANSFERS:
            return []
        sender = (message.get_srcSystem(), message.get_srcComponent())
        if (message.target_system, message.target_component) != us:
            if vehicle in (sender[0], message.target_system):  # ignores the points of other vehicles
                self._others_ns = now_ns
            return []
        if self._transfer is None or sender != (vehicle, mavlink.MAV_COMP_ID_AUTOPILOT1):
            return []
        return self._transfer.on_message(message, now_ns) + self._go_on(now_ns, vehicle, us)

    def _calls_for(self, wanted: tuple[RallyPoint, ...], now_ns: int) -> bool:
        if now_ns < self._next_ns or self._others_are_at_it(now_ns):
            return False
        if not wanted and not self.ours:
            return False
        return self._there is None or moved(self._there, wanted) or (bool(wanted) and now_ns >= self._look_ns)

    def _others_are_at_it(self, now_ns: int) -> bool:
        return self._others_ns is not None and now_ns - self._others_ns < QUIET_NS

    def _go_on(self, now_ns: int, vehicle: int, us: tuple[int, int]) -> list[Any]:
        """Start the step that follows a finished transfer."""
        transfer = self._transfer
        if transfer is None or transfer.outcome is None:
            return []
        self._transfer = None
        self._next_ns = now_ns + PAUSE_NS
        if transfer.outcome != "done":
            return self._failed(transfer, now_ns)
        self._pause_ns = PAUSE_NS
        if not isinstance(transfer, RallyDownload):
            self.uploads += 1
            self._owed = ()
            self._settled(now_ns)
            return []
        points = tuple(transfer.items)
        found = tuple(p for p in points if not any(_same(p, own) for own in self.ours))
        left = tuple(p for p in points if p not in found)
        lost = tuple(p for p in self._owed if not any(_same(p, other) for other in found))
        self.foreign = (*found, *lost)
        if not lost and not moved(left, self._goal):
            self._goal = left
            self._settled(now_ns)
            return []
        if self._others_are_at_it(now_ns):
            return []
        self.ours = (*self.ours, *self._goal)  # stored before the upload, as the program may die meanwhile
        self._transfer = Upload(vehicle, *us, (*self.foreign, *self._goal))
        return self._transfer.poll(now_ns)

    def _settled(self, now_ns: int) -> None:
        self.ours = self._there = self._goal
        self._look_ns = now_ns + LOOK_NS

    def _failed(self, transfer: Transfer, now_ns: int) -> list[Any]:
        self.failures += 1
        self._there = None
        if isinstance(transfer, Upload):
            self._owed = self.foreign
        self._next_ns = now_ns + self._pause_ns
        self._pause_ns = min(2 * self._pause_ns, LONGEST_PAUSE_NS)
        what = "reading" if isinstance(transfer, RallyDownload) else "writing"
        log.warning("%s rally points: %s (%d)", what, transfer.outcome, transfer.refusal)
        return []


def _same(a: RallyPoint, b: RallyPoint) -> bool:
    return abs(a.lat_e7 - b.lat_e7) <= SAME_E7 and abs(a.lon_e7 - b.lon_e7) <= SAME_E7
