"""Ledger of runs: each is counted once, however many artefacts report it."""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace

UNKNOWN_VERSION = ""
SIMULATION = "simulation"
ENVIRONMENTS = (SIMULATION, "recording", "hardware", "flight")
MEASURES = ("begun", "touchdowns", "collisions", "commands", "by_others")
UNITS = {"test": "tests", "campaign": "flights", "landings": "flights", "counts": "flights",
         "fuzz": "inputs", "soak": "soaks"}  # fmt: skip

Seeds = tuple[tuple[int, int], ...]
"""Ranges of seeds, each from its first to the one after its last."""

Key = tuple[str, str, str]  # source, variant, environment


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


@dataclass(frozen=True, slots=True)
class Entry:
    """Counted runs, and the indices of the artefacts that report them."""

    runs: Runs
    artefacts: tuple[int, ...]


Document = dict[tuple[str, str], Entry]
"""A document of counts: its flights, touchdowns, and flights of each hazard, by source and variant."""


class Ledger:
    """Runs of the current program version by kind, without repetitions.

    Of runs that several artefacts report, the largest set is counted, with the most failures that any of them
    reports: a run that failed once does not pass by a repetition. Counts are chosen as whole documents.

    Attributes
    ----------
    repeated
        Number of tests, flights, inputs and soaks, by their unit, that were reported again and counted once.
    left_out
        Number of runs, by their unit, that no counted set has, of documents that overlap a counted one: the
        outcome of their other runs is unknown.
    """

    def __init__(self, program: str, reported: Iterable[Entry]) -> None:
        self.repeated: Counter[str] = Counter()
        self.left_out: Counter[str] = Counter()
        self._entries: defaultdict[Key, list[Entry]] = defaultdict(list)
        current = [entry for entry in reported if entry.runs.program == program]
        of_counts = {entry.artefacts for entry in current if entry.runs.source == "counts"}
        singles = [entry for entry in current if entry.artefacts not in of_counts]
        documents: defaultdict[tuple[int, ...], Document] = defaultdict(dict)
        for entry in current:
            if entry.artefacts in of_counts:
                documents[entry.artefacts][entry.runs.source, entry.runs.variant] = entry
        for entry in (*self._once(singles), *self._chosen(documents.values())):
            self._entries[entry.runs.source, entry.runs.variant, entry.runs.environment].append(entry)

    def entries(self, source: str, variant: str | None = None) -> list[Entry]:
        """Return the counted runs of a source, of one variant or of all."""
        return [
            entry
            for (of, name, _), group in self._entries.items()
            if of == source and variant in (None, name)
            for entry in group
        ]

    def variants(self, source: str) -> list[str]:
        """Return the variants of a source that have runs."""
        return sorted({name for of, name, _ in self._entries if of == source})

    def _once(self, entries: Iterable[Entry]) -> Iterator[Entry]:
        groups: defaultdict[tuple[Key, Seeds], list[Entry]] = defaultdict(list)
        for entry in entries:
            runs = entry.runs
            groups[(runs.source, runs.variant, runs.environment), runs.seeds].append(entry)
        for group in groups.values():
            kept, *again = sorted(group, key=lambda entry: -entry.runs.runs)
            for entry in again:
                if entry.runs.is_whole():
                    self.repeated[UNITS[entry.runs.source]] += entry.runs.runs
                kept = _worst(kept, entry)
            yield kept

    def _chosen(self, documents: Iterable[Document]) -> Iterator[Entry]:
        """Return the counts of documents without common seeds, the largest first, each as a whole.

        Failures of the others are kept: see `_take_failures`. The order of the artefacts does not matter.
        """
        tools: defaultdict[tuple[str, str], list[Document]] = defaultdict(list)
        for document in documents:
            tools[_flights(document).variant, _flights(document).environment].append(document)
        for group in tools.values():
            counted: list[Document] = []
            others: list[Document] = []
            for document in sorted(group, key=_order):
                (others if _overlapped(document, counted) else counted).append(document)
            seen = joined(tuple(seeds for each in counted for seeds in _flights(each).seeds))
            for document in others:
                flights = _flights(document)
                again = common(seen, flights.seeds)
                self.repeated["flights"] += again
                if beyond := flights.runs - again:
                    self.left_out["flights"] += beyond
                _take_failures(_overlapped(document, counted), document, beyond)
                seen = joined((*seen, *flights.seeds))
            yield from (entry for document in counted for entry in document.values())


def _flights(document: Document) -> Runs:
    """Return all flights of a document."""
    return next(entry.runs for entry in document.values() if entry.runs.is_whole())


def _order(document: Document) -> tuple[object, ...]:
    """Return a key that sorts documents: most flights first, then most failures, then by all numbers."""
    flights = _flights(document)
    runs = [entry.runs for entry in document.values()]
    numbers = sorted((each.source, each.variant, each.runs, each.failures, each.is_random) for each in runs)
    return -flights.runs, -flights.failures, numbers, sorted(flights.seeds)


def _overlapped(document: Document, others: Sequence[Document]) -> list[Document]:
    """Return those of other documents that have a flight of a document."""
    seeds = _flights(document).seeds
    return [each for each in others if common(_flights(each).seeds, seeds)]


def _take_failures(counted: Sequence[Document], document: Document, beyond: int) -> None:
    """Add the failures of a document that does not count to the first of those that it overlaps.

    The flights that failed are unknown. As many failures as it has flights `beyond` the known ones may be
    others, and are added; so are the failures that it has more than the counted documents.
    """
    into = counted[0]
    for key, entry in document.items():
        known = sum(each[key].runs.failures for each in counted if key in each)
        more = max(min(entry.runs.failures, beyond), entry.runs.failures - known)
        if key in into or more > 0:
            kept = into.get(key, Entry(replace(entry.runs, runs=0, failures=0, unsafe=0, what=""), ()))
            into[key] = _with_failures(kept, entry, max(more, 0))


def _with_failures(kept: Entry, again: Entry, more: int) -> Entry:
    """Return kept counts with more unsafe flights of others."""
    a, b = kept.runs, again.runs
    failures = a.failures + more
    runs = replace(
        a,
        runs=max(a.runs, failures),
        failures=failures,
        unsafe=failures,
        is_random=a.is_random and b.is_random,
        what="; ".join(dict.fromkeys(text for text in (a.what, b.what) if text)),
    )
    return Entry(runs, tuple(sorted({*kept.artefacts, *again.artefacts})))


def _worst(kept: Entry, again: Entry) -> Entry:
    """Return the kept runs with the most failures of both; skipped is what both skipped."""
    a, b = kept.runs, again.runs
    runs = replace(
        a,
        failures=max(a.failures, b.failures),
        unsafe=max(a.unsafe, b.unsafe),
        skipped=min(a.skipped, b.skipped),
        is_random=a.is_random and b.is_random,
        what=a.what or b.what,
        at_least=a.at_least or b.at_least,
    )
    return Entry(runs, tuple(sorted({*kept.artefacts, *again.artefacts})))


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
