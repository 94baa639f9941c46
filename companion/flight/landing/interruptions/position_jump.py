"""Jumps of the position estimate: stored positions follow, because the vehicle did not move."""

from __future__ import annotations

import numpy as np

from companion.flight.fusion.pose_history import motion_m
from companion.flight.landing.landing_state import LandingState
from companion.flight.landing.situation import COMMANDING, Phase, Severity, Situation, Vector, known


class PositionJump:
    """Compares each situation with the last one that had a position."""

    def __init__(self, state: LandingState) -> None:
        self._state = state
        self._last: Situation | None = None

    def forget(self) -> None:
        """Forget the last position, which belongs to another map frame."""
        self._last = None

    def follow(self, s: Situation) -> None:
        """Shift stored positions by the jump since the last call, if there was one."""
        state, last = self._state, self._last
        if s.position_enu_m is None:
            return
        self._last = s
        if last is None or last.epoch == s.epoch:
            return
        if state.phase in COMMANDING:
            self._shift(last, s)
        if state.phase in (Phase.APPROACH, Phase.DESCEND, Phase.FINAL):
            state.tally.chosen_enu_m = state.aim.enu_m
            state.selection.select(state.aim.enu_m)
        elif state.selection.clear() and state.phase in (Phase.IDLE, Phase.LANDED, Phase.HOLD):
            state.say(Severity.WARNING, "selection lost: select again")

    def _shift(self, last: Situation, s: Situation) -> None:
        """Shift by the jump if it exceeds possible motion: the vehicle may have braked in a gap."""
        state = self._state
        speed_ms = (_or_zero(last.velocity_enu_ms) + _or_zero(s.velocity_enu_ms)) / 2
        elapsed_s = (s.now_ns - last.now_ns) * 1e-9
        jump_m = known(s.position_enu_m) - known(last.position_enu_m) - speed_ms * elapsed_s
        state.say(Severity.WARNING, "position jumped")
        if np.linalg.norm(jump_m) <= motion_m(elapsed_s, state.parameters.pose_timeout_s):
            return
        state.route.move(jump_m)
        state.refused = [point + jump_m for point in state.refused]
        state.aim.move(jump_m)


def _or_zero(vector: Vector | None) -> Vector:
    return np.zeros(3) if vector is None else vector
