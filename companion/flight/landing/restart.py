"""Landing under way across restarts of the companion: kept on disk, and taken up again after a kill."""

from __future__ import annotations

import numpy as np

from companion.flight.landing.executive import Executive
from companion.flight.landing.landing_memory import Landing, LandingMemory
from companion.flight.landing.situation import COMMANDING, Phase, Situation, Vector
from slz import LocalFrame

PATIENCE_NS = 3_000_000_000  # for the position, before the landing is called unwatched
OVER_M = 3.0  # farther from the recorded point it is another landing


class Restart:
    """Resumes a landing, or reports that it is not watched; once, when the autopilot is heard.

    From then on the landing under way is stored for a companion that is started after this one was killed.
    """

    def __init__(self, memory: LandingMemory) -> None:
        self._memory, self._previous = memory, memory.previous
        self._first_ns: int | None = None
        self._kept: tuple[object, ...] | None = None
        self.decided = False

    def update(
        self,
        s: Situation,
        executive: Executive,
        frame: LocalFrame | None,
        sysid: int | None,
        boot_ms: int | None,
    ) -> None:
        """Decide as soon as enough is known, then keep the landing under way.

        Parameters
        ----------
        sysid, boot_ms
            The autopilot's system and time since boot.
        """
        if self.decided:
            self._keep(executive, frame, sysid, boot_ms)
        else:
            self._decide(s, executive, frame, sysid, boot_ms)

    def _keep(
        self, executive: Executive, frame: LocalFrame | None, sysid: int | None, boot_ms: int | None
    ) -> None:
        if executive.phase not in COMMANDING:
            self._kept = None
            self._memory.keep(None)
        elif sysid is not None and boot_ms is not None:
            aim, nowhere = executive.aim_enu_m, (float("nan"),) * 3
            kept = executive.phase, sysid, frame, None if aim is None else tuple(aim.tolist())
            if kept == self._kept:
                return  # nothing that the record would show differently
            self._kept = kept
            place = nowhere if aim is None or frame is None else frame.lla(aim)
            lat, lon, alt = (float(v) for v in place)
            self._memory.keep(Landing(executive.phase.value, sysid, boot_ms, lat, lon, alt))

    def _decide(
        self,
        s: Situation,
        executive: Executive,
        frame: LocalFrame | None,
        sysid: int | None,
        boot_ms: int | None,
    ) -> None:
        if not s.connected or not s.heard:
            return
        self._first_ns = s.now_ns if self._first_ns is None else self._first_ns
        waiting = s.now_ns - self._first_ns < PATIENCE_NS
        if (boot_ms is None or s.on_ground is None or s.position_enu_m is None or frame is None) and waiting:
            return
        self.decided = True
        if not s.armed or s.on_ground is True:
            return
        previous = self._previous
        if previous is not None and not previous.is_of(sysid, boot_ms):
            previous = None
        point = _point(previous, frame)
        if s.landing and point is not None and _over(s, point) and not s.no_command_reason:
            executive.resume_landing(s, point)
        elif previous is not None:
            executive.report_restart(s, "restarted")
        elif s.landing:
            executive.report_restart(s, "started")


def _point(previous: Landing | None, frame: LocalFrame | None) -> Vector | None:
    """Return the point of the autopilot's landing on record, None without one."""
    if previous is None or frame is None or not previous.has_point or previous.phase != Phase.FINAL.value:
        return None
    return frame.enu_m(previous.lat_deg, previous.lon_deg, previous.alt_m)


def _over(s: Situation, point_enu_m: Vector) -> bool:
    if s.position_enu_m is None:
        return False
    return float(np.hypot(*(point_enu_m - s.position_enu_m)[:2])) <= OVER_M
