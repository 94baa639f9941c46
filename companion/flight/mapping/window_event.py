"""Record of a window for replay: its scans and the pipeline's inputs before it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from params import Parameters


@dataclass(frozen=True, slots=True)
class WindowEvent:
    """A window that the pipeline processed.

    number: count of windows before it. scans: first and last number of each unbroken run of scans in it.
    selects: points selected before it, None for no point. anew: whether the map was begun anew before it.
    changed: parameters changed since the window before, by their Python names.
    """

    number: int
    scans: tuple[tuple[int, int], ...]
    selects: tuple[tuple[float, float, float] | None, ...] = ()
    anew: bool = False
    changed: tuple[tuple[str, Any], ...] = ()

    def numbers(self) -> list[int]:
        """Return the numbers of its scans."""
        return [n for first, last in self.scans for n in range(first, last + 1)]


def differences(before: Parameters, after: Parameters) -> tuple[tuple[str, Any], ...]:
    """Return the parameters that differ, by their Python names, with their values after the change."""
    values = before.model_dump()
    return tuple((name, value) for name, value in after.model_dump().items() if value != values[name])


def runs(numbers: list[int]) -> tuple[tuple[int, int], ...]:
    """Return the first and last of each unbroken run of rising numbers."""
    found: list[tuple[int, int]] = []
    for n in numbers:
        if found and n == found[-1][1] + 1:
            found[-1] = (found[-1][0], n)
        else:
            found.append((n, n))
    return tuple(found)
