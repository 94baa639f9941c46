"""What can be seen of a flight from outside: the truth, the modes, the words, the commands."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from companion.landing.situation import Phase
from sitl.modes import Mode
from tests.bench.landings import FLYING_COMMANDS, SETPOINTS

if TYPE_CHECKING:
    from tests.campaign.sortie import Sortie

LOOK_NS = 200_000_000
COMPANION = 191
OURS = (Mode.GUIDED, Mode.LAND)


@dataclass(frozen=True, slots=True)
class Sight:
    """One moment: time, true place and height over ground, speed, mode, and the phase as it is."""

    t_s: float
    e_m: float
    n_m: float
    height_m: float
    level_ms: float
    climb_ms: float
    mode: str
    phase: str


class Witness:
    """Looks at a flight five times a second, and at each message to the autopilot."""

    def __init__(self, sortie: Sortie) -> None:
        self._sortie = sortie
        self._next_ns = 0
        self._receive = sortie.sim.autopilot.receive
        sortie.sim.autopilot.receive = self._overhear  # type: ignore[method-assign]
        self._pilot_since_ns: int | None = None
        self._held_since_s: float | None = None
        self.sights: list[Sight] = []
        self.commands_while_pilot_flies = 0
        self.began_s: float | None = None
        self.ended_s: float | None = None
        self.heard_before = 0

    @property
    def now_s(self) -> float:
        return self._sortie.sim.now_ns * 1e-9

    @property
    def pilot_has_it_s(self) -> float:
        """How long a mode that is not the companion's has been flown."""
        since = self._pilot_since_ns
        return 0.0 if since is None else self.now_s - since * 1e-9

    @property
    def held_s(self) -> float:
        """How long the companion has been waiting for somebody to take over."""
        return 0.0 if self._held_since_s is None else self.now_s - self._held_since_s

    def fault_begins(self) -> None:
        self.began_s = self.now_s
        self.heard_before = len(self._sortie.heard)
        self._look_now()

    def fault_ends(self) -> None:
        self.ended_s = self.now_s

    def look(self) -> None:
        """Look at the simulation after a tick."""
        autopilot, now_ns = self._sortie.sim.autopilot, self._sortie.sim.now_ns
        if not autopilot.armed or autopilot.mode in OURS:
            self._pilot_since_ns = None
        elif self._pilot_since_ns is None:
            self._pilot_since_ns = now_ns
        if now_ns >= self._next_ns:
            self._next_ns = now_ns + LOOK_NS
            self._look_now()

    def _look_now(self) -> None:
        s = self._sortie
        truth = s.sim.vehicle.truth
        e, n, _ = (float(v) for v in truth.pos_enu_m)
        ve, vn, vu = (float(v) for v in truth.vel_enu_ms)
        if s.phase is not Phase.HOLD:
            self._held_since_s = None
        elif self._held_since_s is None:
            self._held_since_s = self.now_s
        level_ms = (ve * ve + vn * vn) ** 0.5
        self.sights.append(
            Sight(self.now_s, e, n, s.height_m, level_ms, vu, s.sim.autopilot.mode_name, s.phase.value)
        )

    def _overhear(self, message: Any, link: int, now_ns: int) -> None:
        autopilot = self._sortie.sim.autopilot
        commands = message.get_type() in SETPOINTS or getattr(message, "command", None) in FLYING_COMMANDS
        pilots = autopilot.armed and autopilot.mode not in OURS
        if commands and pilots and message.get_srcComponent() == COMPANION:
            # What was on its way when the mode changed is no command against the pilot.
            self.commands_while_pilot_flies += self.pilot_has_it_s > 1.5
        self._receive(message, link, now_ns)
