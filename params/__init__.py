"""Parameters: one table, profiles, and their validation."""

from params.load import (
    AUTOPILOT_FILES,
    PROFILES,
    RENAMED,
    Grounded,
    ParameterError,
    airworthy,
    allowed,
    autopilot_file,
    build,
    check_airworthy,
    grounded,
    load,
    unknown,
)
from params.required import Required, required
from params.spec import Spec
from params.table import Parameters, Row, rows

__all__ = [
    "AUTOPILOT_FILES",
    "PROFILES",
    "RENAMED",
    "Grounded",
    "ParameterError",
    "Parameters",
    "Required",
    "Row",
    "Spec",
    "airworthy",
    "allowed",
    "autopilot_file",
    "build",
    "check_airworthy",
    "grounded",
    "load",
    "required",
    "rows",
    "unknown",
]
