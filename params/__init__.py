"""Parameters: one table, profiles, and their validation."""

from params.autopilot_files import AUTOPILOT_FILES, autopilot_file
from params.grounded import Grounded, airworthy, check_airworthy, grounded
from params.load import PROFILES, RENAMED, ParameterError, allowed, build, load, unknown
from params.required import Required, required
from params.table import Parameters, Row, Spec, rows

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
