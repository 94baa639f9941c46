"""Hazards (FMEA) and the parts of run-time assurance, read from `hazards.toml` and `assurance.toml`."""

from __future__ import annotations

import functools
import tomllib
from dataclasses import dataclass, fields
from enum import Enum
from importlib import resources
from typing import Any


class Severity(Enum):
    """Worst credible effect, without barriers; likelihoods are not estimated."""

    CATASTROPHIC = "catastrophic"  # people are hurt
    HAZARDOUS = "hazardous"  # the vehicle is lost, beside people perhaps
    MAJOR = "major"  # the landing fails and the pilot must act at once
    MINOR = "minor"  # the landing is delayed or given up


class Role(Enum):
    """Parts of a run-time assurance architecture."""

    COMPLEX = "complex function"
    INPUT = "input check"
    MONITOR = "monitor"
    SWITCH = "switch"
    RECOVERY = "recovery function"


@dataclass(frozen=True, slots=True)
class Hazard:
    """A hazard, its barriers, and the evidence that they hold.

    Attributes
    ----------
    presumptions
        Rows of the table of preconditions in docs/reactions.md that it would break.
    failures
        Beginnings of the rows of docs/reactions.md, "What fails", that it belongs to.
    barriers
        Code, as `module:name`.
    tests
        Node IDs; the name of a file includes all its tests.
    campaign, landings, fuzz, soak
        Faults, kinds of flights, harnesses and clocks.
    counts
        Names of hazards in counts by other tools; those of `campaign`, and the ID, count as well.
    measures
        Measures over all kinds of flights: touchdowns, collisions, commands.
    """

    id: str
    title: str
    cause: str
    effect: str
    severity: Severity
    reaction: str
    barriers: tuple[str, ...]
    presumptions: tuple[str, ...] = ()
    failures: tuple[str, ...] = ()
    tests: tuple[str, ...] = ()
    campaign: tuple[str, ...] = ()
    landings: tuple[str, ...] = ()
    fuzz: tuple[str, ...] = ()
    soak: tuple[str, ...] = ()
    counts: tuple[str, ...] = ()
    measures: tuple[str, ...] = ()
    limits: str = ""


@dataclass(frozen=True, slots=True)
class Part:
    """A part of run-time assurance: role, name, implementation and code."""

    role: Role
    name: str
    text: str
    code: tuple[str, ...] = ()


@functools.cache
def hazards() -> tuple[Hazard, ...]:
    """Return all hazards in the order of the file."""
    return tuple(_hazard(each) for each in _document("hazards.toml")["hazard"])


@functools.cache
def assurance_parts() -> tuple[Part, ...]:
    """Return the parts of run-time assurance in the order of the file."""
    return tuple(
        Part(Role(each["role"]), each["name"], each["text"], tuple(each.get("code", ())))
        for each in _document("assurance.toml")["part"]
    )


def _document(name: str) -> dict[str, Any]:
    return tomllib.loads(resources.files(__package__).joinpath(name).read_text("utf-8"))


def _hazard(table: dict[str, Any]) -> Hazard:
    """Return a hazard; an unknown key or a value of another type raises."""
    unknown = table.keys() - {field.name for field in fields(Hazard)}
    if unknown:
        raise ValueError(f"hazards.toml, {table.get('id')}: unknown {', '.join(sorted(unknown))}")
    values: dict[str, Any] = {name: tuple(v) if isinstance(v, list) else v for name, v in table.items()}
    values["severity"] = Severity(table["severity"])
    return Hazard(**values)
