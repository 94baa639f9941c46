"""Runtime parameters: changed in flight and stored for the next start."""

from __future__ import annotations

import json
import tomllib
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any, cast

import params
from companion.runtime.errors import UsageError
from companion.runtime.event import Event
from companion.runtime.state_directory import StateDir
from params import ParameterError, Parameters, Row

FILE = "parameters.toml"


@dataclass(frozen=True, slots=True)
class Change:
    """Result of a change: whether the value is kept, and the text for the pilot."""

    accepted: bool
    reason: str


class Settings:
    """Holder of the parameters in force and of those for the next start.

    A value whose row is `live` takes effect at once, any other at the next start. A value that is out of
    range, must not fly (`params.load`) or conflicts with others, now or at the next start, is refused.

    Attributes
    ----------
    running, stored
        Parameters in force; those of the next start.
    rows
        Parameter table.
    on_change
        Event (Python name, value) of a changed parameter.
    on_running
        Event of the parameters in force after a change.
    """

    def __init__(self, parameters: Parameters, state: StateDir | None = None) -> None:
        self.running = self.stored = parameters
        self._state = state
        self._changed = {} if state is None else read_stored(state)
        self.on_change: Event[[str, Any]] = Event()
        self.on_running: Event[[Parameters]] = Event()
        self.rows = params.rows()
        self._rows = {row.name: row for row in self.rows}

    @property
    def live(self) -> Parameters:
        """View of the parameters in force that follows changes; for readers that keep it."""
        return cast(Parameters, _Live(self))

    def change(self, name: str, value: Any) -> Change:
        """Set a parameter by its Python name; an invalid value is refused."""
        row = self._rows[name]
        try:
            stored = params.build(self.stored.model_dump() | {name: value})
            running = self.running
            if row.live:
                running = params.build(running.model_dump() | {name: value})
        except ParameterError as error:
            return Change(False, f"{row.mavlink}: {_short(str(error), row)}")
        new = getattr(stored, name)
        if new in row.grounded:
            return Change(False, f"{row.mavlink}: {new} must not fly: {row.grounded[new]}")
        if new == getattr(self.stored, name):
            return Change(True, "")
        changed = self._changed | {name: new}
        if self._state is not None and (fault := self._state.write_behind(FILE, _toml(changed))):
            return Change(False, f"{row.mavlink} not kept: {fault}")
        self.stored, self.running, self._changed = stored, running, changed
        self.on_change.emit(name, new)
        self.on_running.emit(running)
        when = "now" if row.live else "at the next start"
        return Change(True, f"{row.mavlink} {_shown(new)} {row.unit}".rstrip() + f" {when}")


class _Live:
    """View of the parameters in force; what was read is at hand until one of them changes."""

    def __init__(self, settings: Settings) -> None:
        self._settings = settings
        settings.on_change.subscribe(self._forget)

    def __getattr__(self, name: str) -> Any:
        value = getattr(self._settings.running, name)
        self.__dict__[name] = value
        return value

    def _forget(self, _name: str, _value: Any) -> None:
        settings = self._settings
        self.__dict__.clear()
        self._settings = settings


def load(profile: str, settings: Iterable[str], state: StateDir) -> Parameters:
    """Return the parameters to start with: profile, then values set in flight, then the command line.

    Raises
    ------
    ParameterError
        The profile or a setting is wrong or must not fly.
    UsageError
        A stored value is: the user decides whether to start without it.
    """
    settings = list(settings)
    params.check_airworthy(params.load(profile, settings))  # reports their own faults first
    try:
        return params.check_airworthy(params.load(profile, settings, read_stored(state)))
    except ParameterError as error:
        raise UsageError(f"{state.folder / FILE}: {error}; mend or delete the file") from None


def read_stored(state: StateDir) -> dict[str, Any]:
    """Return the values of the state directory's file; raise `UsageError` if it is not TOML."""
    try:
        return tomllib.loads(state.read(FILE) or "")
    except (ValueError, RecursionError) as error:
        raise UsageError(f"{state.folder / FILE}: {error}; mend or delete the file") from None


def _toml(values: dict[str, Any]) -> str:
    lines = (f"{name} = {json.dumps(value)}\n" for name, value in sorted(values.items()))
    return "# Set over MAVLink; --set on the command line wins over these.\n" + "".join(lines)


def _short(error: str, row: Row) -> str:
    """Return a refusal without the name, which precedes it, because the pilot's screen is narrow."""
    return f"must be {params.allowed(row, in_flight=True)}" if "is refused: it must be" in error else error


def _shown(value: Any) -> str:
    return value if isinstance(value, str) else f"{value:g}"
