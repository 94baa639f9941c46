"""Watch on who commands the vehicle in its guided mode, by the target that the autopilot reports.

ArduCopter and PX4 take the targets of every sender in turn, without a word. A ground station's "fly to here"
(DO_REPOSITION) to ArduPilot lasts until our next setpoint, 50 ms. The autopilot's target is in
POSITION_TARGET_LOCAL_NED; ours is always a velocity. It does not name the sender of another, but such
messages may be heard on our link.
"""

from __future__ import annotations

from collections import deque
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from companion.flight.link.clock.message_order import boot_step_ms
from companion.flight.link.link import Link
from companion.runtime.clock import now_ns

SECOND = 1_000_000_000
PAUSE_NS = SECOND // 2  # without a setpoint of ours, after which another run of them begins
KEPT_NS = 4 * SECOND  # for which a setpoint may be reported: ArduPilot flies the last one for 3 s
SENDER_NS = 5 * SECOND  # between another's message and the target that it explains
FOREIGN_VELOCITIES = 3  # within a second, of none that was ours: avoidance may change one for a moment
OFF_MS = 0.4  # rounding, and the autopilot's shaping of a velocity
POSITION = (
    mavlink.POSITION_TARGET_TYPEMASK_X_IGNORE
    | mavlink.POSITION_TARGET_TYPEMASK_Y_IGNORE
    | mavlink.POSITION_TARGET_TYPEMASK_Z_IGNORE
)
VELOCITY = (
    mavlink.POSITION_TARGET_TYPEMASK_VX_IGNORE
    | mavlink.POSITION_TARGET_TYPEMASK_VY_IGNORE
    | mavlink.POSITION_TARGET_TYPEMASK_VZ_IGNORE
)
SETPOINTS = ("SET_POSITION_TARGET_LOCAL_NED", "SET_POSITION_TARGET_GLOBAL_INT", "SET_ATTITUDE_TARGET")

Floats = NDArray[np.float64]


class CommanderWatch:
    """Compares the autopilot's reported targets with our setpoints.

    A target counts as another's only after one of ours was reported in the same run of setpoints: before that
    the autopilot flies what it flew before us. Evidence stays until the guided mode ends or a new run begins.
    """

    def __init__(self, link: Link) -> None:
        self._link = link
        self._ours: deque[tuple[int, Floats]] = deque()  # time and velocity, north, east, down
        self._last_ns = -KEPT_NS
        self._idle = True
        self._reported_boot_ms: int | None = None  # of the newest report of a target of ours in this run
        self._foreign_ns: deque[int] = deque(maxlen=FOREIGN_VELOCITIES)
        self._foreign = False
        self._sender: tuple[int, str] | None = None
        link.subscribe("POSITION_TARGET_LOCAL_NED", self._on_target)
        link.subscribe("POSITION_TARGET_GLOBAL_INT", self._on_place)
        link.subscribe("NAV_CONTROLLER_OUTPUT", self._on_course)
        for name in (*SETPOINTS, "COMMAND_LONG", "COMMAND_INT"):
            link.subscribe(name, self._on_order, anyone=True)

    def on_setpoint(self, velocity_enu_ms: Floats, at_ns: int, *, idle: bool = False) -> None:
        """Record a setpoint that was sent; idle: one that only keeps the guided mode open."""
        if at_ns - self._last_ns > PAUSE_NS or (self._idle and not idle):
            self._begin()
        self._last_ns, self._idle = at_ns, idle
        east, north, up = (float(v) for v in velocity_enu_ms)
        self._ours.append((at_ns, np.array([north, east, -up])))
        while at_ns - self._ours[0][0] > KEPT_NS:
            self._ours.popleft()

    @property
    def is_foreign(self) -> bool:
        """True if the vehicle follows another's target in its guided mode, so that we must be silent."""
        if not self._link.vehicle.guided:
            self._begin()
        return self._foreign

    def commander(self) -> str:
        """Return whose target the vehicle follows while we command it: "" ours, "255/190" or "another"."""
        at_ns = now_ns()
        if not self.is_foreign or self._idle or at_ns - self._last_ns > PAUSE_NS:
            return ""
        heard = self._sender is not None and at_ns - self._sender[0] < SENDER_NS
        return self._sender[1] if heard and self._sender is not None else "another"

    # ---- evidence -------------------------------------------------------------------------------

    def _begin(self) -> None:
        self._reported_boot_ms, self._foreign = None, False
        self._foreign_ns.clear()

    @property
    def _is_ours_known(self) -> bool:
        """True if our setpoints arrive, and the autopilot has reported to follow one."""
        fresh = now_ns() - self._last_ns <= PAUSE_NS
        return fresh and self._link.vehicle.guided and self._reported_boot_ms is not None

    def _on_target(self, message: Any, at_ns: int) -> None:
        """Use a reported target; one older than a report of ours was overtaken on the way."""
        if not self._link.vehicle.guided or at_ns - self._last_ns > PAUSE_NS:
            return
        if message.type_mask & POSITION != POSITION:
            known_ms = self._reported_boot_ms
            if known_ms is not None and boot_step_ms(known_ms, message.time_boot_ms) > 0:
                self._foreign = True
            return
        velocity = np.array([message.vx, message.vy, message.vz], np.float64)
        if message.type_mask & VELOCITY or not np.isfinite(velocity).all():
            return
        if self._explains(velocity):
            self._reported_boot_ms = message.time_boot_ms
        elif self._is_ours_known:
            self._foreign_ns.append(at_ns)
            oldest_ns = self._foreign_ns[0]
            if len(self._foreign_ns) == FOREIGN_VELOCITIES and at_ns - oldest_ns < SECOND:
                self._foreign = True

    def _explains(self, velocity_ned_ms: Floats) -> bool:
        """Return whether a target is a setpoint of ours, stopped, or limited by the autopilot.

        An avoidance that backs off turns, shortens or reverses a velocity; others shorten its level and its
        vertical part, each for itself.
        """
        ours = np.array([sent for _, sent in self._ours])
        backs_off_ms = self._link.vehicle.autopilot.backs_off_ms
        if backs_off_ms is not None:
            most_ms = float(np.linalg.norm(ours, axis=1).max(initial=0.0)) + backs_off_ms
            return float(np.linalg.norm(velocity_ned_ms)) <= most_ms
        off = np.stack([_off(velocity_ned_ms[axes], ours[:, axes]) for axes in (slice(0, 2), slice(2, 3))])
        return bool(off.max(axis=0).min() <= OFF_MS)

    def _on_place(self, message: Any, at_ns: int) -> None:
        """Use the global target of an autopilot that sends it in its guided mode for positions alone.

        Others send the point of their navigator, followed or not.
        """
        if self._link.vehicle.autopilot.reports_guided_points and self._is_ours_known:
            known_ms = self._reported_boot_ms or 0
            self._foreign = self._foreign or boot_step_ms(known_ms, message.time_boot_ms) > 0

    def _on_course(self, message: Any, at_ns: int) -> None:
        """Use the distance to a point, which is zero while such an autopilot follows a velocity."""
        reports = self._link.vehicle.autopilot.reports_guided_points
        if reports and self._is_ours_known and message.wp_dist > 0:
            self._foreign_ns.append(at_ns)
            self._foreign = self._foreign or len(self._foreign_ns) == FOREIGN_VELOCITIES

    def _on_order(self, message: Any, at_ns: int) -> None:
        """Remember who else sent the vehicle a target; some obey "fly to here" in their guided mode."""
        link, sender = self._link, (message.get_srcSystem(), message.get_srcComponent())
        repositions = getattr(message, "command", None) == mavlink.MAV_CMD_DO_REPOSITION
        is_target = repositions or message.get_type() in SETPOINTS
        if not is_target or sender == (link.system_id, link.component_id):
            return
        if message.target_system not in (0, link.vehicle.sysid):
            return
        self._sender = at_ns, f"{sender[0]}/{sender[1]}"
        obeyed = link.vehicle.autopilot.obeys_reposition or not repositions
        self._foreign = self._foreign or (obeyed and self._is_ours_known)


def _off(velocity: Floats, ours: Floats) -> Floats:
    """Return the distance of a velocity from each of ours, (n, k), or from a shorter one in its direction."""
    squared = np.maximum(np.sum(ours * ours, axis=1), 1e-9)
    share = np.clip(ours @ velocity / squared, 0.0, 1.0)[:, None]
    return np.asarray(np.linalg.norm(share * ours - velocity, axis=1))
