"""Jumps of the position estimate: stored positions follow, because the vehicle did not move."""

from __future__ import annotations

import numpy as np

from companion.flight.fusion.pose_history import motion_m
from companion.flight.landing.aim import PointSelection
from companion.flight.landing.assist.assist import Assist
from companion.flight.landing.landing_progress import LandingProgress
from companion.flight.landing.pilot_texts import PilotTexts
from companion.flight.landing.route import Route
from companion.flight.landing.situation import COMMANDING, Phase, Severity, Situation, Vector, known
from params import Parameters


class PositionJump:
    """Compares each situation with the last one that had a position."""

    def __init__(
        self,
        parameters: Parameters,
        progress: LandingProgress,
        texts: PilotTexts,
        route: Route,
        selection: PointSelection,
        assist: Assist,
    ) -> None:
        self._p, self._progress, self._texts = parameters, progress, texts
        self._route, self._selection, self._assist = route, selection, assist
        self._last: Situation | None = None

    def forget(self) -> None:
        """Forget the last position, which belongs to another map frame."""
        self._last = None

    def follow(self, s: Situation) -> None:
        """Shift stored positions by the jump since the last call, if there was one."""
        progress, last = self._progress, self._last
        if s.position_enu_m is None:
            return
        self._last = s
        if last is None or last.epoch == s.epoch:
            return
        if progress.phase in COMMANDING or self._assist.leads:
            self._shift(last, s)
        else:
            self._assist.forget()
        if progress.phase in (Phase.APPROACH, Phase.DESCEND, Phase.FINAL):
            progress.tally.chosen_enu_m = progress.aim.enu_m
            self._selection.select(progress.aim.enu_m)
        elif self._assist.leads:
            self._selection.select(self._assist.aim.enu_m)
        elif self._selection.clear() and progress.phase in (Phase.IDLE, Phase.LANDED, Phase.HOLD):
            self._texts.say(Severity.WARNING, "selection lost: select again")

    def _shift(self, last: Situation, s: Situation) -> None:
        """Shift by the jump if it exceeds possible motion: the vehicle may have braked in a gap."""
        progress = self._progress
        speed_ms = (_or_zero(last.velocity_enu_ms) + _or_zero(s.velocity_enu_ms)) / 2
        elapsed_s = (s.now_ns - last.now_ns) * 1e-9
        jump_m = known(s.position_enu_m) - known(last.position_enu_m) - speed_ms * elapsed_s
        self._texts.say(Severity.WARNING, "position jumped")
        if np.linalg.norm(jump_m) <= motion_m(elapsed_s, self._p.pose_timeout_s):
            return
        self._route.move(jump_m)
        progress.refused = [point + jump_m for point in progress.refused]
        progress.aim.move(jump_m)
        self._assist.move(jump_m)


def _or_zero(vector: Vector | None) -> Vector:
    return np.zeros(3) if vector is None else vector
