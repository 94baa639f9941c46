"""Required autopilot parameters, read from the same files that a ground station loads.

`autopilot/arducopter.parm` holds lines ``NAME VALUE``, `autopilot/px4.params` lines ``vehicle component NAME
VALUE type`` separated by tabs. The comment lines before a parameter give the reason. ``#: accept A B`` or
``#: accept LOW..HIGH`` lists other valid values, ``#: wanted`` marks a recommendation, ``#: critical`` a
parameter without which an automatic landing is refused, ``#: optional`` a parameter that some versions do not
have: ground stations and autopilots skip it there. Files whose names end in `_odometry` hold what the LiDAR
odometry adds.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from importlib import resources
from typing import Literal

# Values pass through 32-bit floats on the link.
TOLERANCE = 1e-5
RULES = ("accept", "wanted", "critical", "optional")


@dataclass(frozen=True, slots=True)
class Required:
    """Parameter of the autopilot: the value to set, other accepted values, and the reason.

    accepted: single values, or (low, high) both inclusive, besides the value itself.
    level: needed if the system does not work without it, wanted if it only works less well.
    why: the reason.
    integer: PX4's type, None where the autopilot has none.
    critical: whether an automatic landing needs it confirmed, because with a wrong value the vehicle would
        land beside the point, or be in danger if the companion failed.
    optional: whether some versions do not have it.
    """

    name: str
    value: float
    accepted: tuple[float, ...] | tuple[tuple[float, float]]
    level: Literal["needed", "wanted"]
    why: str
    integer: bool | None = None
    critical: bool = False
    optional: bool = False

    def accepts(self, value: float) -> bool:
        """Return whether a vehicle's value is accepted."""
        if _same(value, self.value):
            return True
        return any(
            e[0] - TOLERANCE <= value <= e[1] + TOLERANCE if isinstance(e, tuple) else _same(value, e)
            for e in self.accepted
        )

    def accepted_text(self) -> str:
        """Return the accepted values in words."""
        if self.accepted and isinstance(self.accepted[0], tuple):
            low, high = self.accepted[0]
            return f"{low:g} to {high:g}"
        return " or ".join(f"{value:g}" for value in sorted({self.value, *self._singles()}))

    def _singles(self) -> Iterator[float]:
        return (value for value in self.accepted if not isinstance(value, tuple))


def required(*files: str) -> tuple[Required, ...]:
    """Return the required parameters of files in `autopilot`; of one that two name, the later wins."""
    folder = resources.files("params").joinpath("autopilot")
    found = (row for file in files for row in parse(folder.joinpath(file).read_text("utf-8")))
    return tuple({row.name: row for row in found}.values())


def parse(text: str) -> tuple[Required, ...]:
    """Read a parameter file.

    Raises
    ------
    ValueError
        If a line is neither comment nor parameter, a name occurs twice, or a value violates its own rule.
    """
    found: dict[str, Required] = {}
    notes: list[str] = []
    for number, line in enumerate(text.splitlines(), 1):
        stripped = line.strip()
        if stripped.startswith("#"):
            notes = [*notes, stripped] if stripped.strip("# ") else []
        elif not stripped:
            notes = []
        else:
            try:
                row = _row(stripped.split(), notes)
            except ValueError as error:
                raise ValueError(f"line {number}: {error}") from None
            if row.name in found:
                raise ValueError(f"line {number}: {row.name} stands twice")
            found[row.name] = row
            notes = []
    return tuple(found.values())


def _row(words: list[str], notes: list[str]) -> Required:
    integer = None
    if len(words) == 5:
        integer = words[4] == "6"
        words = words[2:4]
    if len(words) != 2:
        raise ValueError("neither NAME VALUE nor a line of a .params file")
    rules = [note.removeprefix("#:").split() for note in notes if note.startswith("#:")]
    unknown = [rule for rule in rules if not rule or rule[0] not in RULES]
    if unknown:
        raise ValueError(f"unknown rule {' '.join(unknown[0])!r}")
    accepted = next((_accepted(rule[1:]) for rule in rules if rule[0] == "accept"), ())
    why = " ".join(note.lstrip("# ") for note in notes if not note.startswith("#:"))
    level: Literal["needed", "wanted"] = "wanted" if ["wanted"] in rules else "needed"
    critical, optional = ["critical"] in rules, ["optional"] in rules
    row = Required(words[0], float(words[1]), accepted, level, why, integer, critical, optional)
    if accepted and isinstance(accepted[0], tuple) and not accepted[0][0] <= row.value <= accepted[0][1]:
        raise ValueError(f"{row.name} {row.value:g} is outside what it accepts")
    return row


def _accepted(words: list[str]) -> tuple[float, ...] | tuple[tuple[float, float]]:
    if len(words) == 1 and ".." in words[0]:
        low, high = (float(part) for part in words[0].split(".."))
        return ((low, high),)
    return tuple(float(word) for word in words)


def _same(a: float, b: float) -> bool:
    return math.isclose(a, b, rel_tol=TOLERANCE, abs_tol=TOLERANCE)
