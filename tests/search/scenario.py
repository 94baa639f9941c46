"""Scenarios of the search: a vector of named parameters, each with its range and default."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from tests.search.flown_file import InputError, read_object

SCENES = ("landing_site", "buildings", "borrow_pit")
KINDS = ("none", "box", "ball", "post")
FAULTS = (
    *("none", "lidar_half", "lidar_stop", "lidar_stuck", "lidar_clock", "lidar_plumes", "lidar_dust"),
    *("link_bursts", "link_reordering", "link_duplicates", "ekf_jump", "estimate_sway", "gps_multipath"),
)


@dataclass(frozen=True, slots=True)
class Range:
    """Range of a number, and its default: that of a flight in which nothing happens."""

    low: float
    high: float
    default: float
    whole: bool = False


@dataclass(frozen=True, slots=True)
class Choice:
    """Choice of one of several; the first is the default."""

    values: tuple[str, ...]

    @property
    def default(self) -> str:
        return self.values[0]


SPACE: dict[str, Range | Choice] = {
    "scene": Choice(SCENES),
    "seed": Range(0, 19, 0, whole=True),
    "start_deg": Range(0.0, 360.0, 0.0),
    "point_east_m": Range(-1.5, 1.5, 0.0),
    "point_north_m": Range(-1.5, 1.5, 0.0),
    "wind_ms": Range(0.0, 8.0, 0.0),
    "wind_from_deg": Range(0.0, 360.0, 0.0),
    "gust_ms": Range(0.0, 2.5, 0.0),
    "drift_ms": Range(0.0, 0.1, 0.0),
    "drift_to_deg": Range(0.0, 360.0, 0.0),
    "dust_below_m": Range(0.0, 2.0, 0.0),
    "link_delay_s": Range(0.0, 0.2, 0.0),
    "late_s": Range(0.0, 0.8, 0.0),
    "fault": Choice(FAULTS),
    "fault_below_m": Range(1.0, 5.5, 5.5),
    "fault_s": Range(0.5, 10.0, 0.5),
    "hazard": Choice(KINDS),
    "hazard_size_m": Range(0.6, 3.0, 1.0),
    "hazard_height_m": Range(0.4, 2.0, 1.0),
    "hazard_aside_m": Range(0.0, 5.0, 0.0),
    "hazard_aside_deg": Range(0.0, 360.0, 0.0),
    "hazard_from_deg": Range(0.0, 360.0, 0.0),
    "hazard_speed_ms": Range(4.0, 10.0, 6.0),
    "hazard_below_m": Range(4.0, 5.5, 5.5),
}
"""Parameters of a scenario.

start: bearing of the place of the take-off. point: ordered, from the scene's safe place. seed: moves what the
scene holds, sensor noise and gusts. drift: of the GPS position, in the descent. dust: the rotors raise it
below that height. link_delay_s: of every message, either way. late_s: of every computed window. A fault lasts
fault_s from when the vehicle sinks below fault_below_m. The hazard comes `hazard.FROM_M` from the compass
direction hazard_from_deg when the vehicle sinks below hazard_below_m, and stops aside of the point.
"""

Value = float | str
DEFAULTS: dict[str, Value] = {name: part.default for name, part in SPACE.items()}


@dataclass(frozen=True, slots=True)
class Scenario:
    """One scenario; the same values are the same flight."""

    values: Mapping[str, Value]

    @classmethod
    def of(cls, **values: Value) -> Scenario:
        """Return the default scenario with other values of some parameters.

        Raises
        ------
        ValueError
            A parameter is unknown or its value out of range.
        """
        for name, value in values.items():
            part = SPACE.get(name)
            if part is None:
                raise ValueError(f"scenario: there is no parameter {name!r}")
            inside = (
                value in part.values
                if isinstance(part, Choice)
                else isinstance(value, int | float)
                and not isinstance(value, bool)
                and part.low <= value <= part.high
                and not (part.whole and value % 1)
            )
            if not inside:
                raise ValueError(f"scenario: {name} cannot be {value!r}")
        return cls(DEFAULTS | values)

    def number(self, name: str) -> float:
        return float(self.values[name])

    def text(self, name: str) -> str:
        return str(self.values[name])

    def changed(self) -> dict[str, Value]:
        """Return the parameters that are not at their defaults."""
        return {name: value for name, value in self.values.items() if value != DEFAULTS[name]}

    def replaced(self, name: str, value: Value) -> Scenario:
        """Return a scenario with another value of one parameter."""
        return Scenario({**self.values, name: value})


def is_default(scenario: Scenario, name: str) -> bool:
    """Return whether a parameter is at its default: for fault and hazard, that there is none."""
    return bool(scenario.values[name] == DEFAULTS[name])


def is_angle(name: str) -> bool:
    """Return whether a parameter wraps around."""
    return name.endswith("_deg")


def acting(scenario: Scenario) -> list[str]:
    """Return the names of the parameters that change the flight: not those of a fault or hazard of none."""
    idle = [f"{kind}_" for kind in ("fault", "hazard") if is_default(scenario, kind)]
    if scenario.values["hazard"] == "post":
        idle.append("hazard_size_m")
    return [name for name in SPACE if not name.startswith(tuple(idle))]


def uniform(rng: np.random.Generator) -> Scenario:
    """Draw every parameter evenly from its range."""
    return Scenario({name: draw(part, rng) for name, part in SPACE.items()})


def one_trouble(rng: np.random.Generator) -> Scenario:
    """Draw every parameter evenly, but of fault and hazard at most one."""
    scenario = uniform(rng)
    spared = "fault" if rng.random() < 0.5 else "hazard"
    troubled = not any(is_default(scenario, name) for name in ("fault", "hazard"))
    return scenario.replaced(spared, DEFAULTS[spared]) if troubled else scenario


def telling(rng: np.random.Generator) -> Scenario:
    """Draw as `uniform`, but more of what tells something by its response.

    Three of twenty scenarios have neither fault nor hazard: only a vehicle that lands shows how well. Six
    have a hazard in the way and no fault, three a LiDAR that falls silent.
    """
    scenario, aside = uniform(rng), SPACE["hazard_aside_m"]
    assert isinstance(aside, Range)
    scenario = scenario.replaced("hazard_aside_m", rounded(aside, aside.high * rng.random() ** 2.5))
    kind = int(rng.integers(20))
    if kind < 3:
        return scenario.replaced("fault", DEFAULTS["fault"]).replaced("hazard", DEFAULTS["hazard"])
    if kind < 9:
        scenario = scenario.replaced("fault", DEFAULTS["fault"])
        return scenario.replaced("hazard", some_hazard(rng))
    return scenario.replaced("fault", "lidar_stop") if kind < 12 else scenario


def some_hazard(rng: np.random.Generator) -> str:
    """Draw a kind of hazard that is not none."""
    return KINDS[1 + int(rng.integers(len(KINDS) - 1))]


def draw(part: Range | Choice, rng: np.random.Generator) -> Value:
    """Draw one parameter evenly."""
    if isinstance(part, Choice):
        return part.values[int(rng.integers(len(part.values)))]
    return rounded(part, float(rng.uniform(part.low, part.high)))


def rounded(part: Range, value: float) -> float:
    """Return a value within its range, a whole one where it must be, else with four digits."""
    inside = min(max(value, part.low), part.high)
    return float(round(inside)) if part.whole else float(round(inside, 4))


KEPT = ("scenario", "weakness", "detail", "found", "outcome", "program")  # of the file of a failure


def read(path: Path) -> Scenario:
    """Read a scenario from a JSON file with the key "scenario", or of its values alone.

    Raises
    ------
    InputError
        The file holds no scenario, or a key beside it that means nothing.
    """
    found = read_object(path)
    if not found:
        raise InputError(f'{path} is empty: {{"scenario": {{}}}} is the flight in which nothing happens')
    unknown = [key for key in found if "scenario" in found and key not in KEPT]
    if unknown:
        raise InputError(f"{path}: {unknown[0]!r} means nothing, only {', '.join(KEPT)}")
    values = found.get("scenario", found)
    try:
        return Scenario.of(**values)
    except (TypeError, ValueError) as error:
        raise InputError(f"{path}: {error}") from None
