"""Selection of a failsafe's action, its delay and the pilot's takeover (commander/failsafe/framework.cpp)."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from enum import Enum, IntEnum, auto


class Action(IntEnum):
    """Actions; of several, the last in this order is taken."""

    NONE = 0
    WARN = 1
    POSITION = 2
    ALTITUDE = 3
    STABILIZED = 4
    HOLD = 5
    RTL = 6
    LAND = 7
    DESCEND = 8
    DISARM = 9
    TERMINATE = 10


class Takeover(IntEnum):
    """Means by which the pilot interrupts an action; of several, the last in this order is needed."""

    ALWAYS = 0
    MODE_SWITCH = 1
    NEVER = 2
    AUTO = 3  # ALWAYS with a delay before the action, else MODE_SWITCH


class Clear(Enum):
    """End of an action: with its cause, or after its cause by a change of mode or a disarm."""

    WITH_CAUSE = auto()
    ON_MODE_CHANGE = auto()
    NEVER = auto()


@dataclass(slots=True)
class Cause:
    """A failure that is present: its name, and what it calls for."""

    name: str
    action: Action
    clear: Clear = Clear.WITH_CAUSE
    takeover: Takeover = Takeover.AUTO
    is_present: bool = True


INTERRUPTIBLE = (Action.HOLD, Action.RTL, Action.LAND, Action.DESCEND)


class ActionSelector:
    """Active causes, and the action of the worst.

    Attributes
    ----------
    selected
        Action that is taken.
    is_taken_over
        Whether the pilot has interrupted one.
    delay_s
        Time of Hold that is left before a new action.
    """

    def __init__(self) -> None:
        self.selected = Action.NONE
        self.is_taken_over = False
        self.delay_s = 0.0
        self._active: dict[str, Cause] = {}

    @property
    def in_failsafe(self) -> bool:
        """True for HEARTBEAT's critical state."""
        return self.selected not in (Action.NONE, Action.WARN)

    def clear_after(self, *, takeover_too: bool = False) -> None:
        """Remove actions without a cause, at a change of mode, or with the takeover at an (un)arming."""
        self._active = {
            name: cause
            for name, cause in self._active.items()
            if cause.is_present or cause.clear is not Clear.ON_MODE_CHANGE
        }
        self.is_taken_over = self.is_taken_over and not takeover_too

    def observe(
        self, causes: Iterable[Cause], elapsed_s: float, start_delay_s: float, can_hold: bool
    ) -> None:
        """Take the causes that are present now (checkFailsafe, removeNonActivatedActions)."""
        self.delay_s = max(0.0, self.delay_s - elapsed_s)
        present = {cause.name: cause for cause in causes}
        for name, cause in present.items():
            if name in self._active:
                self._active[name].is_present, self._active[name].action = True, cause.action
                continue
            self._active[name] = cause
            if cause.takeover is Takeover.AUTO:
                delayed = start_delay_s > 0.1
                cause.takeover = Takeover.ALWAYS if delayed else Takeover.MODE_SWITCH
                if delayed and cause.action is not Action.WARN and self.delay_s == 0:
                    self.delay_s = start_delay_s
            self.is_taken_over = self.is_taken_over and cause.action < Action.HOLD
        for name in [name for name in self._active if name not in present]:
            self._active[name].is_present = False
            if self._active[name].clear is Clear.WITH_CAUSE:
                del self._active[name]
        if self.selected > Action.HOLD or not can_hold or self.is_taken_over:
            self.delay_s = 0.0

    def select(self, *, mode_changed: bool, sticks: bool) -> tuple[Action, Action]:
        """Return the action to take and the one that waits behind a Hold (getSelectedAction).

        A takeover turns the action into a warning; `is_taken_over` tells it.
        """
        if self.selected is Action.TERMINATE:
            return Action.TERMINATE, Action.NONE
        causes = self._active.values()
        worst = max((cause.action for cause in causes), default=Action.NONE)
        allowed = max((cause.takeover for cause in causes), default=Takeover.ALWAYS)
        delayed = Action.NONE
        waits = worst not in (Action.NONE, Action.HOLD, Action.DISARM, Action.TERMINATE)
        if self.delay_s > 0 and not self.is_taken_over and allowed <= Takeover.MODE_SWITCH and waits:
            delayed, worst, allowed = worst, Action.HOLD, Takeover.MODE_SWITCH
        switched = mode_changed and self.selected > Action.WARN
        wanted = {Takeover.ALWAYS: switched or sticks, Takeover.MODE_SWITCH: switched}.get(allowed, False)
        self.is_taken_over = (
            worst in INTERRUPTIBLE and allowed is not Takeover.NEVER and (self.is_taken_over or bool(wanted))
        )
        return (Action.WARN, Action.NONE) if self.is_taken_over else (worst, delayed)
