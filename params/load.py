"""Loader of validated `Parameters` from a profile, a TOML file and `name=value` settings."""

from __future__ import annotations

import difflib
import tomllib
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from importlib import resources
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from params.table import Parameters, Row, rows

PROFILES = ("quadcopter", "helicopter", "radar")
RENAMED = {"max_slope_deg": "worst_slope_deg", "SLZ_MAX_SLOPE": "SLZ_WORST_SLOPE"}  # old names: today's


class ParameterError(ValueError):
    """Unknown, unreadable or out-of-range parameter; the message is one line for the user."""


def load(
    profile: str = "quadcopter", settings: Iterable[str] = (), stored: Mapping[str, Any] | None = None
) -> Parameters:
    """Build parameters from a profile, stored values and settings; later ones take precedence.

    Parameters
    ----------
    profile
        `quadcopter`, `helicopter`, `radar` or the path of a TOML file. A file may select the profile that it
        starts from with `profile = "helicopter"`; the default is `quadcopter`.
    settings
        `name=value` strings; name is the Python or the MAVLink name.
    stored
        Python names and values that were set over MAVLink in earlier flights.

    Raises
    ------
    ParameterError
        Unknown profile, name or choice, unreadable file or value, or value out of range.
    """
    values = _profile(profile) | dict(stored or {})
    by_name = {key: row for row in rows() for key in (row.name, row.mavlink)}
    for setting in settings:
        name, equals, text = setting.partition("=")
        if not equals:
            raise ParameterError(f"setting {setting!r}: write it as name=value")
        row = by_name.get(name.strip())
        if row is None:
            raise ParameterError(unknown(name.strip()))
        values[row.name] = text.strip()
    return build(values)


def build(values: Mapping[str, Any]) -> Parameters:
    """Validate a mapping of Python names to values; raise `ParameterError` with name, value and range."""
    for name in values:
        if name not in Parameters.model_fields:
            raise ParameterError(unknown(name))
    try:
        return Parameters(**values)
    except ValidationError as error:
        raise ParameterError("; ".join(_sentence(detail) for detail in error.errors())) from None


def _profile(profile: str) -> dict[str, Any]:
    if profile in PROFILES:
        text = resources.files("params").joinpath(f"profiles/{profile}.toml").read_text("utf-8")
        return _toml(text, profile)
    path = Path(profile)
    if path.suffix != ".toml":
        raise ParameterError(f"profile {profile!r} is unknown: use {', '.join(PROFILES)} or a .toml file")
    try:
        text = path.read_text("utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise ParameterError(f"profile {profile!r} cannot be read: {error}") from None
    own = _toml(text, profile)
    base = own.pop("profile", PROFILES[0])
    if base not in PROFILES:
        raise ParameterError(f"profile {base!r} named in {profile} is unknown: use {', '.join(PROFILES)}")
    return _profile(base) | own


def _toml(text: str, name: str) -> dict[str, Any]:
    try:
        return tomllib.loads(text)
    except (ValueError, RecursionError) as error:  # TOML, a number too long, lists too deep
        raise ParameterError(f"profile {name!r} is not valid TOML: {error}") from None


def unknown(name: str) -> str:
    """Return the refusal of a name that is none of a parameter, with the one that was probably meant."""
    if name in RENAMED:
        return f"parameter {name!r} is called {RENAMED[name]!r} now"
    near = difflib.get_close_matches(name, Parameters.model_fields, 1)
    hint = f"did you mean {near[0]!r}?" if near else "'slz params' lists them all"
    return f"parameter {name!r} is unknown: {hint}"


def _sentence(detail: Any) -> str:
    if not detail["loc"]:
        return str(detail["msg"]).removeprefix("Value error, ")
    name = str(detail["loc"][0])
    row = next(row for row in rows() if row.name == name)
    return f"parameter {name} = {detail['input']!r} is refused: it must be {allowed(row)}"


def allowed(row: Row, *, in_flight: bool = False) -> str:
    """Return the accepted values of a parameter in words; in flight without those that must not fly."""
    if row.choices:
        return " or ".join(row.airworthy_choices if in_flight else row.choices)
    unit = f" {row.unit}" if row.unit else ""
    number = "a whole number" if row.kind is int else "a number"
    return f"{number} from {row.low:g} to {row.high:g}{unit}"


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
        raise ParameterError("; ".join(_refusal(one) for one in found))
    return parameters


def _refusal(one: Grounded) -> str:
    return f"parameter {one.row.name} = {one.value!r} must not fly: it {one.reason}; use {one.allowed}"


AUTOPILOT_FILES = (
    "arducopter.parm",
    "arducopter_odometry.parm",
    "px4.params",
    "px4_odometry.params",
    "px4_sih.params",
)


def autopilot_file(name: str) -> tuple[str, str]:
    """Return file name and text of a parameter file by its name, with or without the ending.

    Raises
    ------
    ParameterError
        There is no such file.
    """
    for file in AUTOPILOT_FILES:
        if name in (file, file.partition(".")[0]):
            return file, resources.files("params").joinpath("autopilot", file).read_text("utf-8")
    known = ", ".join(file.partition(".")[0] for file in AUTOPILOT_FILES)
    raise ParameterError(f"no parameter file {name!r}: there are {known}")
