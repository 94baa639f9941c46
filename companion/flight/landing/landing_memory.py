"""Persistent record of the landing in progress, for a companion restarted in flight."""

from __future__ import annotations

import json
import logging
import math
from dataclasses import asdict, dataclass

from companion.runtime.state_directory import StateDir

log = logging.getLogger(__name__)

FILE = "landing.json"
OLDEST_MS = 900_000  # a landing recorded longer ago is a different one


@dataclass(frozen=True, slots=True)
class Landing:
    """A landing in progress.

    phase: name of the executive's phase. sysid, boot_ms: system and time since boot of the autopilot, which
    identify its flight. lat_deg, lon_deg, alt_m: target point, NaN without one.
    """

    phase: str
    sysid: int
    boot_ms: int
    lat_deg: float
    lon_deg: float
    alt_m: float

    @property
    def key(self) -> str:
        """Text that is unchanged while the point moves by less than a decimetre."""
        return f"{self.phase} {self.sysid} {self.lat_deg:.6f} {self.lon_deg:.6f} {self.alt_m:.1f}"

    @property
    def has_point(self) -> bool:
        """True if there is a target point."""
        return all(map(math.isfinite, (self.lat_deg, self.lon_deg, self.alt_m)))

    def is_of(self, sysid: int | None, boot_ms: int | None) -> bool:
        """Return whether this landing belongs to the present flight of an autopilot with this clock."""
        return sysid == self.sysid and boot_ms is not None and 0 <= boot_ms - self.boot_ms <= OLDEST_MS


class LandingMemory:
    """Keeps the landing in progress in the state directory, without waiting for the disk.

    Parameters
    ----------
    state
        State directory; None keeps nothing.

    Attributes
    ----------
    previous
        Record of the previous companion; None if that ended its last flight or its record is not readable.
    """

    def __init__(self, state: StateDir | None) -> None:
        self._state = state
        self.previous = None if state is None else _read(state)
        self._kept: str | None = None

    def keep(self, landing: Landing | None) -> None:
        """Store a landing, None after its end; writes only changes."""
        if self._state is None:
            return
        key = None if landing is None else landing.key
        if key == self._kept and not (landing is None and self.previous is not None):
            return
        self._kept, self.previous = key, None
        text = "" if landing is None else json.dumps(asdict(landing))
        why_not = self._state.write_behind(FILE, text)
        if why_not:
            log.error("the landing under way is not kept: %s", why_not)


def _read(state: StateDir) -> Landing | None:
    text = state.read(FILE, damaged=True)
    if not text:
        return None
    try:
        return Landing(**json.loads(text))
    except (ValueError, TypeError):
        log.warning("%s cannot be read, a flight under way is not known", state.folder / FILE)
        return None
