"""Parameters: one table, profiles, and their validation."""

from params.load import PROFILES, ParameterError, allowed, build, load
from params.required import Required, required
from params.table import Parameters, Row, Spec, rows

__all__ = [
    "PROFILES",
    "ParameterError",
    "Parameters",
    "Required",
    "Row",
    "Spec",
    "allowed",
    "build",
    "load",
    "required",
    "rows",
]
