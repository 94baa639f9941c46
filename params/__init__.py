"""Parameters: one table, profiles, and their validation."""

from params.autopilot_files import AUTOPILOT_FILES, autopilot_file
from params.grounded import Grounded, airworthy, check_airworthy, grounded
from params.load import PROFILES, ParameterError, allowed, build, load
from params.required import Required, required
from params.table import Parameters, Row, Spec, rows

__all__ = [
    "AUTOPILOT_FILES",
    "PROFILES",
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
]
