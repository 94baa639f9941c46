"""Values that must not fly: refused by `slz run`, `slz demo` and in flight, reported by `slz doctor`.

The table names them (`Spec.grounded`). Surveys, replays, benches and tests may still use them.
"""

from __future__ import annotations

from dataclasses import dataclass

from params.load import ParameterError, allowed
from params.table import Parameters, Row, rows


@dataclass(frozen=True, slots=True)
class Grounded:
    """A parameter's value that must not fly, and the reason, a predicate of the value."""

    row: Row
    value: str
    reason: str

    @property
    def allowed(self) -> str:
        """Values that may fly, in words."""
        return allowed(self.row, in_flight=True)


def grounded(parameters: Parameters) -> tuple[Grounded, ...]:
    """Return the values that must not fly, in the order of the table."""
    chosen = ((row, getattr(parameters, row.name)) for row in rows() if row.grounded)
    return tuple(Grounded(row, value, row.grounded[value]) for row, value in chosen if value in row.grounded)


def airworthy(parameters: Parameters) -> Parameters:
    """Return parameters that may fly: the defaults in place of grounded values."""
    return parameters.model_copy(update={one.row.name: one.row.default for one in grounded(parameters)})


def check_airworthy(parameters: Parameters) -> Parameters:
    """Return the parameters unchanged.

    Raises
    ------
    ParameterError
        A value must not fly.
    """
    if found := grounded(parameters):
        raise ParameterError("; ".join(_sentence(one) for one in found))
    return parameters


def _sentence(one: Grounded) -> str:
    return f"parameter {one.row.name} = {one.value!r} must not fly: it {one.reason}; use {one.allowed}"
