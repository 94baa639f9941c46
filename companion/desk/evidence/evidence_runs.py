"""Runs that an artefact reports: their kind, seeds, program version, and outcome."""

from __future__ import annotations

from dataclasses import dataclass

UNKNOWN_VERSION = ""
SIMULATION = "simulation"
ENVIRONMENTS = (SIMULATION, "recording", "hardware", "flight")
MEASURES = ("begun", "touchdowns", "collisions", "commands", "by_others")
UNITS = {"test": "tests", "campaign": "flights", "landings": "flights", "counts": "flights",
         "fuzz": "inputs", "soak": "soaks"}  # fmt: skip

Seeds = tuple[tuple[int, int], ...]
"""Ranges of seeds, each from its first to the one after its last."""


@dataclass(frozen=True, slots=True)
class Runs:
    """Runs of one kind and variant, by one version of the program; two with common seeds are the same runs.

    Attributes
    ----------
    source
        Kind of evidence: test, campaign, landings, fuzz, soak, counts; or a measure over several kinds:
        begun (landings, by counts alone), touchdowns, collisions, commands, by_others (brought down by the
        pilot or a failsafe).
    variant
        Test's node ID, fault, kind of flight, harness, clock, or the tool and hazard of a count.
    failures
        Runs that did not end as required, the unsafe ones included.
    unsafe
        Runs that touched unsafe ground, hit something, or commanded against the pilot.
    at_least
        Whether failures is only the least number of them: then they have no bound.
    is_random
        Whether the runs are independent random draws; without this a count has no bound.
    what
        First failure in words.
    """

    source: str
    variant: str
    seeds: Seeds
    program: str
    runs: int = 1
    failures: int = 0
    unsafe: int = 0
    skipped: int = 0
    is_random: bool = True
    environment: str = SIMULATION
    what: str = ""
    at_least: bool = False

    def is_whole(self) -> bool:
        """Return whether these are whole runs, not a measure of them or those of them that met a hazard."""
        return self.source not in MEASURES and (self.source != "counts" or self.variant.endswith(":"))


def one(number: int) -> Seeds:
    """Return the seeds of a single run."""
    return ((number, number + 1),)


def common(a: Seeds, b: Seeds) -> int:
    """Return the number of seeds in both, each of ranges without a common seed."""
    return sum(max(0, min(p[1], q[1]) - max(p[0], q[0])) for p in a for q in b)


def size(seeds: Seeds) -> int:
    """Return the number of seeds in ranges without a common seed."""
    return sum(end - first for first, end in seeds)


def joined(seeds: Seeds) -> Seeds:
    """Return ranges in order, without common seeds; neighbouring ranges are one."""
    found: list[tuple[int, int]] = []
    for first, end in sorted(seeds):
        if found and first <= found[-1][1]:
            found[-1] = (found[-1][0], max(found[-1][1], end))
        else:
            found.append((first, end))
    return tuple(found)


def seeds_text(seeds: Seeds) -> str:
    """Return ranges as text, such as `0-1999, 5000`."""
    ranges = joined(seeds)
    return ", ".join(f"{first}" if end == first + 1 else f"{first}-{end - 1}" for first, end in ranges)
