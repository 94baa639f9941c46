"""Metadata of a parameter, and the sources of parameters."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from pydantic import Field

PAPER = "SLZ paper Table 4"
THESIS = "SLZ thesis Table 3"
OURS = "this project"


@dataclass(frozen=True, slots=True)
class Spec:
    """Metadata of a parameter besides its type, range and default.

    live: a change takes effect at once; otherwise at the next start.
    grounded: choices that must not fly, each with the reason (`params.load`).
    """

    mavlink: str
    unit: str
    source: str
    sentence: str
    live: bool = False
    grounded: Mapping[str, str] = field(default_factory=dict)


def in_range(low: float, high: float) -> Any:
    """Return the closed range of a parameter."""
    return Field(ge=low, le=high)
