"""Minimal scenario of a failure: fewest parameters off their defaults, by the least that still fails."""

from __future__ import annotations

from collections.abc import Callable

from tests.search.scenario import DEFAULTS, SPACE, Choice, Range, Scenario, is_angle, rounded

HALVINGS = 3
GROUPS = ("drift", "dust", "fault", "hazard", "link", "late", "gust", "wind", "point", "start")


def shrink(scenario: Scenario, fails: Callable[[Scenario], bool], most: int = 80) -> Scenario:
    """Return the smallest scenario found that still fails, in at most so many flights.

    First whole groups of parameters go back to their defaults, then single ones, then numbers half of the
    way, and half again; angles have no magnitude and are left.
    """
    left = most

    def tried(other: Scenario) -> bool:
        nonlocal left
        if left <= 0 or other == scenario:
            return False
        left -= 1
        return fails(other)

    for group in GROUPS:
        names = [name for name in scenario.changed() if name.startswith(group)]
        reset = Scenario({**scenario.values, **{name: DEFAULTS[name] for name in names}})
        if names and tried(reset):
            scenario = reset
    for name in scenario.changed():
        if tried(reset := scenario.replaced(name, DEFAULTS[name])):
            scenario = reset
    for name in scenario.changed():
        part = SPACE[name]
        if isinstance(part, Choice) or is_angle(name) or part.whole:
            continue
        scenario = _halved(scenario, name, part, tried)
    return scenario


def _halved(scenario: Scenario, name: str, part: Range, tried: Callable[[Scenario], bool]) -> Scenario:
    """Bring a number as near to its default as it still fails, by halving."""
    works, fails_at = part.default, scenario.number(name)
    for _ in range(HALVINGS):
        between = scenario.replaced(name, rounded(part, (works + fails_at) / 2))
        if tried(between):
            scenario, fails_at = between, between.number(name)
        else:
            works = between.number(name)
    return scenario
