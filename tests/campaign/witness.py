"""Outside observations of a flight: the truth, modes, texts, commands."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from companion.flight.landing.situation import Phase
from sitl.autopilot.modes import Mode
from tests.bench.landings import FLYING_COMMANDS, SETPOINTS

if TYPE_CHECKING:
    from tests.campaign.sortie import Sortie

LOOK_NS = 200_000_000
COMPANION = 191
OURS = (Mode.GUIDED, Mode.LAND)
PILOT, FAILSAFE, NOBODY = "pilot", "failsafe", ""
# What was on its way when the vehicle was taken, or when that was seen, is no command against who has it.
GRACE_S = {PILOT: 1.5, FAILSAFE: 2.0}


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
    """Looks at a flight five times a second, and at each message to the autopilot.

    Attributes
    ----------
    taken_by, taken_s
        Who has first taken the vehicle from the companion since the fault began, the pilot or a failsafe of
        the autopilot, by the simulator's truth; and when.
    over_s
        When nothing was left of that failsafe, though the vehicle may still fly what it chose; None before.
    landed_by
        Who had it when it touched the ground or something else: empty for the companion.
    """

    def __init__(self, sortie: Sortie) -> None:
        self._sortie = sortie
        self._next_ns = 0
        self._receive = sortie.sim.autopilot.receive
        sortie.sim.autopilot.receive = self._overhear  # type: ignore[method-assign]
        self._taker, self._taken_ns = NOBODY, 0
        self._held_since_s: float | None = None
        self.sights: list[Sight] = []
        self.commands_while_pilot_flies = 0
        self.taken_by, self.taken_s = NOBODY, 0.0
        self.over_s: float | None = None
        self.landed_by = NOBODY
        self.began_s: float | None = None
        self.ended_s: float | None = None
        self.heard_before = 0
        self._ended = False

    @property
    def now_s(self) -> float:
        return self._sortie.sim.now_ns * 1e-9

    @property
    def taken_for_s(self) -> float:
        """How long the pilot or the autopilot's failsafe has had the vehicle."""
        return 0.0 if self._taker == NOBODY else self.now_s - self._taken_ns * 1e-9

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
        now_ns = self._sortie.sim.now_ns
        self._follow_taker(now_ns)
        if now_ns >= self._next_ns:
            self._next_ns = now_ns + LOOK_NS
            self._look_now()

    def _follow_taker(self, now_ns: int) -> None:
        taker, safe = self._now_with(), self._sortie.sim.autopilot.failsafes
        self._look_at_the_end(self._taker or taker)  # a crash disarms at once
        if taker != self._taker:
            self._taker, self._taken_ns = taker, now_ns
            if taker != NOBODY and self.began_s is not None and self.taken_by == NOBODY:
                self.taken_by, self.taken_s = taker, self.now_s
        over = self.taken_by == FAILSAFE and not (safe.any_triggered or safe.fence.breached)
        if over and self.over_s is None:
            self.over_s = self.now_s

    def _now_with(self) -> str:
        """Return who has the vehicle now if not the companion: by the modes, the sticks and the failsafes."""
        autopilot = self._sortie.sim.autopilot
        if not autopilot.armed:
            return NOBODY
        if autopilot.failsafes.in_charge:
            return FAILSAFE
        if autopilot.airframe.on_wing:
            return PILOT
        return PILOT if autopilot.mode not in OURS or autopilot.navigator.repositioned else NOBODY

    def _look_at_the_end(self, taker: str) -> None:
        """Note who had the vehicle when it came down."""
        vehicle = self._sortie.sim.vehicle
        ended = vehicle.contact is not None or vehicle.collision is not None
        if ended and not self._ended:
            self.landed_by = taker
        self._ended = ended

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
        commands = message.get_type() in SETPOINTS or getattr(message, "command", None) in FLYING_COMMANDS
        if commands and self._taker != NOBODY and message.get_srcComponent() == COMPANION:
            self.commands_while_pilot_flies += self.taken_for_s > GRACE_S[self._taker]
        self._receive(message, link, now_ns)
