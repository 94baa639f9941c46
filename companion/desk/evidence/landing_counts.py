"""Counts of landings: a small JSON document that any tool can write, and its reader.

{"format": "slz-counts", "version": 1, "program": "0.2.0+1f3a9c02b7de", "tool": "search",
 "environment": "simulation", "sampling": "independent", "seeds": [[0, 10000]],
 "flights": 10000, "safe": 9100, "refused": 500, "aborted": 400, "failsafe": 0, "unsafe": 0,
 "by_hazard": {"box": {"flights": 2500, "safe": 2100, "refused": 200, "aborted": 200, "unsafe": 0}}}
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import Any

from companion.desk.evidence.artefact_fields import MOST_SEED, ArtefactError, Fields
from companion.desk.evidence.evidence_ledger import (
    ENVIRONMENTS,
    SIMULATION,
    UNKNOWN_VERSION,
    Runs,
    Seeds,
    size,
)
from companion.desk.evidence.flight_results import CAMPAIGN, FUZZ, LANDINGS, SOAK, TOUCHDOWNS
from companion.runtime.program_version import program_version

COUNTS, COUNTS_FORMAT, COUNTS_VERSION = "counts", "slz-counts", 1
BEGUN = "begun"
ENDS = ("safe", "refused", "aborted", "failsafe", "unsafe")
INDEPENDENT, ADAPTIVE = "independent", "adaptive"
RESERVED = ("test", CAMPAIGN, LANDINGS, FUZZ, SOAK)  # they have artefacts of their own


def counts_document(
    tool: str,
    seeds: Sequence[tuple[int, int]],
    ends: Mapping[str, int],
    by_hazard: Mapping[str, Mapping[str, int]],
    *,
    sampling: str = INDEPENDENT,
    environment: str = SIMULATION,
) -> dict[str, Any]:
    """Return the document of flights by this version of the program, to be written as JSON.

    Parameters
    ----------
    seeds
        Ranges of seeds, each from its first to the one after its last. A seed identifies one flight of the
        tool: of draws from a generator's sequence, number them over all sequences.
    ends
        Number of flights by their end, see `ENDS`.
    by_hazard
        The same of the flights that met a hazard, by its name.
    sampling
        "independent" for seeds drawn without regard to what came of others; "adaptive" for a search.
    """
    return {
        "format": COUNTS_FORMAT,
        "version": COUNTS_VERSION,
        "program": program_version(),
        "tool": tool,
        "environment": environment,
        "sampling": sampling,
        "seeds": [list(each) for each in seeds],
        "flights": sum(ends.values()),
        **{end: ends.get(end, 0) for end in ENDS},
        "by_hazard": {
            name: {"flights": sum(part.values()), **{end: part.get(end, 0) for end in ENDS}}
            for name, part in by_hazard.items()
        },
    }


def read_counts(document: Fields) -> list[Runs]:
    """Return all flights of a document, its landings begun, its touchdowns, and the flights of each hazard.

    Raises
    ------
    ArtefactError
        A field is missing or impossible, the ends do not add up to the flights, a count of a hazard exceeds
        that of all flights, ranges of seeds overlap, or there is not one seed for each flight.
    """
    document.version(COUNTS_VERSION)
    tool = document.text("tool")
    if not tool.strip() or tool in RESERVED or ":" in tool:
        raise document.bad("tool", f"a name other than {', '.join(RESERVED)}, not empty and without a colon")
    common: dict[str, Any] = {
        "seeds": _seeds(document),
        "program": document.text("program", UNKNOWN_VERSION),
        "is_random": document.choice("sampling", (INDEPENDENT, ADAPTIVE)) == INDEPENDENT,
        "environment": document.choice("environment", ENVIRONMENTS),
    }
    total = _ends(document)
    flights, unsafe = total["flights"], total["unsafe"]
    if flights != (seeds := size(common["seeds"])):
        raise document.bad("flights", f"one flight for each seed, {seeds},")
    what = f"{tool}: {unsafe} unsafe of {flights}" if unsafe else ""
    touchdowns = total["safe"] + unsafe
    begun = touchdowns + total["aborted"]
    found = [
        Runs(COUNTS, f"{tool}:", runs=flights, failures=unsafe, unsafe=unsafe, what=what, **common),
        Runs(BEGUN, tool, runs=begun, failures=unsafe, unsafe=unsafe, what=what, **common),
        Runs(TOUCHDOWNS, tool, runs=touchdowns, failures=unsafe, unsafe=unsafe, what=what, **common),
    ]
    hazards = document.part("by_hazard")
    for name in hazards.values:
        part = hazards.part(name)
        ends = _ends(part)
        for end, count in ends.items():
            if count > total[end]:
                raise part.bad(end, f"at most the {total[end]} of all flights")
        flights, unsafe = ends["flights"], ends["unsafe"]
        what = f"{tool}, {name}: {unsafe} unsafe of {flights}" if unsafe else ""
        found.append(
            Runs(COUNTS, f"{tool}:{name}", runs=flights, failures=unsafe, unsafe=unsafe, what=what, **common)
        )
    return found


def _ends(part: Fields) -> dict[str, int]:
    """Return the number of flights, and of those with each end; every flight has one end."""
    flights = part.count("flights")
    ends = {end: part.count(end, 0 if end == "failsafe" else None) for end in ENDS}
    if sum(ends.values()) != flights:
        raise part.bad("flights", f"the sum of the ends, {sum(ends.values())},")
    return {"flights": flights, **ends}


def _seeds(document: Fields) -> Seeds:
    ranges = []
    for each in document.items("seeds"):
        whole = (
            isinstance(each, list)
            and len(each) == 2
            and all(type(v) is int and abs(v) <= MOST_SEED for v in each)
        )
        if not whole or each[0] >= each[1]:
            raise document.bad("seeds", "ranges [first, last + 1] of whole numbers to 2^64")
        ranges.append((each[0], each[1]))
    if not ranges:
        raise document.bad("seeds", "one range at least")
    in_order = sorted(ranges)
    for before, after in pairwise(in_order):
        if after[0] < before[1]:
            raise ArtefactError(
                f"--artefact {document.where}: 'seeds' {list(before)} and {list(after)} overlap: a seed is "
                "one flight, so name it and count its flight once"
            )
    return tuple(ranges)
