"""Ledger of runs: each is counted once, however many artefacts report it."""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Iterable
from dataclasses import dataclass, replace

from companion.desk.evidence.evidence_runs import UNITS, Runs, Seeds, common, overlap, size

Key = tuple[str, str, str]  # source, variant, environment


@dataclass(frozen=True, slots=True)
class Entry:
    """Counted runs, and the indices of the artefacts that report them."""

    runs: Runs
    artefacts: tuple[int, ...]


class Ledger:
    """Runs of the current program version by kind, without repetitions.

    Of runs that several artefacts report, the largest set is counted, with the most failures that any of them
    reports: a run that failed once does not pass by a repetition.

    Attributes
    ----------
    repeated
        Number of tests, flights, inputs and soaks, by their unit, that were reported again and counted once.
    left_out
        The same of those that no counted set has, but whose document overlaps one that is counted: the
        outcome of its other runs cannot be told.
    """

    def __init__(self, program: str, reported: Iterable[Entry]) -> None:
        self.repeated: Counter[str] = Counter()
        self.left_out: Counter[str] = Counter()
        self._entries: dict[Key, list[Entry]] = {}
        groups: defaultdict[Key, list[Entry]] = defaultdict(list)
        for entry in reported:
            if entry.runs.program == program:
                runs = entry.runs
                groups[runs.source, runs.variant, runs.environment].append(entry)
        for key, group in groups.items():
            self._entries[key] = self._without_repetitions(group)

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

    def _without_repetitions(self, group: list[Entry]) -> list[Entry]:
        counted: list[Entry] = []
        exact: dict[Seeds, int] = {}  # many sets are a single run: these are looked up
        ranges: list[int] = []
        for entry in sorted(group, key=lambda e: -e.runs.runs):
            seeds = entry.runs.seeds
            same = exact.get(seeds)
            others = (
                [same] if same is not None else [k for k in ranges if overlap(counted[k].runs.seeds, seeds)]
            )
            if not others:
                exact[seeds] = len(counted)
                if entry.runs.runs > 1 or seeds[0][1] - seeds[0][0] > 1 or len(seeds) > 1:
                    ranges.append(len(counted))
                counted.append(entry)
                continue
            if entry.runs.is_whole():
                self._note_repetition(entry.runs, [counted[k].runs.seeds for k in others])
            for k in others:
                counted[k] = _worst(counted[k], entry)
        return counted

    def _note_repetition(self, runs: Runs, kept: list[Seeds]) -> None:
        """Note how many of the runs are counted already, and how many are lost with them."""
        again = runs.runs
        if size(runs.seeds) == runs.runs:
            again = sum(common(seeds, runs.seeds) for seeds in kept)
        self.repeated[UNITS[runs.source]] += again
        if again < runs.runs:
            self.left_out[UNITS[runs.source]] += runs.runs - again


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
    )
    return Entry(runs, tuple(sorted({*kept.artefacts, *again.artefacts})))
