"""Safety case: evidence of the runs for each hazard, with upper bounds of probabilities."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from enum import Enum

from scipy.special import betaincinv

from companion.desk.evidence.artefact_file import Artefact
from companion.desk.evidence.evidence_ledger import MEASURES, SIMULATION, Entry, Ledger
from companion.desk.evidence.hazard_list import Hazard, Severity

CONFIDENCE = 0.95

KINDS = ("test", "campaign", "landings", "fuzz", "soak", "counts")
MOST_FAILURES = 10  # of one row that are named


class State(Enum):
    """State of a hazard's evidence, the worst first: the order of the page."""

    UNSAFE = "UNSAFE"  # touched unsafe ground, hit something, or commanded against the pilot
    FAILED = "FAILED"
    NONE = "NO EVIDENCE"
    PARTIAL = "evidence in part"
    SHOWN = "evidence"


@dataclass(frozen=True, slots=True)
class Finding:
    """Runs of one link of a hazard.

    Attributes
    ----------
    label
        Kind and name, such as "campaign lidar_stop".
    runs
        Without the skipped ones, and those in which the hazard did not come.
    is_random
        Whether the runs are independent random draws.
    at_least
        Whether failures is only the least number of them.
    failed_bound, unsafe_bound
        Upper bounds at 95 % of their probability in a run; None where runs are no random draws, or where the
        number of failures is not known.
    failures_named
        The first failures in words.
    """

    label: str
    source: str
    environment: str
    is_random: bool
    runs: int
    failures: int
    at_least: bool
    unsafe: int
    skipped: int
    failed_bound: float | None
    unsafe_bound: float | None
    failures_named: tuple[str, ...]
    artefacts: tuple[int, ...]


@dataclass(frozen=True, slots=True)
class HazardEvidence:
    """A hazard, the state of its evidence and its findings; a finding without a run is missing evidence."""

    hazard: Hazard
    state: State
    findings: tuple[Finding, ...]

    def links(self) -> tuple[int, int]:
        """Return the number of links with a run, and the number of links that the hazard asks for.

        The second is the same whichever artefacts there are: a link with several findings is one link, and
        counts by other tools are none.
        """
        asked = [finding for finding in self.findings if finding.source != "counts"]
        return len({f.label for f in asked if f.runs}), len({f.label for f in asked})

    def counts_with_runs(self) -> int:
        """Return the number of counts by other tools that have a run of the hazard."""
        return len({f.label for f in self.findings if f.source == "counts" and f.runs})


@dataclass(frozen=True, slots=True)
class SafetyCase:
    """All hazards with their evidence, by one version of the program.

    Attributes
    ----------
    hazards
        Those that failed first, then those without evidence; of each state the most severe first.
    measures
        Landings begun by counts; touchdowns, collisions, commands against the pilot, and ends under the pilot
        or a failsafe, over all kinds of flights.
    unlinked
        Failures of runs that no hazard of the list names.
    equal_counts
        Pairs of artefacts and their tools whose counts are the same in everything but the tool: one may be a
        copy of the other.
    unknown_counts
        Names of counts that belong to no hazard of the list.
    repeated
        Runs that several artefacts report, counted once, by their unit: tests, flights, inputs, soaks.
    left_out
        Runs of counts that overlap larger ones in part, and are in none that is counted, by their unit.
    """

    program: str
    artefacts: tuple[Artefact, ...]
    hazards: tuple[HazardEvidence, ...]
    measures: tuple[Finding, ...]
    unlinked: tuple[Finding, ...]
    equal_counts: tuple[tuple[int, str, int, str], ...]
    unknown_counts: tuple[str, ...]
    repeated: Mapping[str, int]
    left_out: Mapping[str, int]

    def number(self, state: State) -> int:
        """Return the number of hazards in a state."""
        return sum(each.state is state for each in self.hazards)


def make_case(hazards: Sequence[Hazard], artefacts: Sequence[Artefact], program: str) -> SafetyCase:
    """Return the safety case of a version of the program; runs of other versions do not count."""
    reported = (Entry(runs, (k,)) for k, artefact in enumerate(artefacts) for runs in artefact.runs)
    ledger = Ledger(program, reported)
    judged = [_judged(hazard, ledger) for hazard in hazards]
    states, severities = list(State), list(Severity)
    measures = [f for name in MEASURES for f in _findings(name, ledger.entries(name)) if f.runs]
    linked = {e for h in hazards for _, entries in _links(h, ledger) for e in entries}
    others = [entry for source in KINDS for entry in ledger.entries(source) if entry not in linked]
    # Every failure of all flights of a document of counts is one of its touchdowns.
    has_touchdowns = any("touchdowns" in hazard.measures for hazard in hazards)
    unlinked = [
        finding
        for entry in others
        if entry.runs.failures
        and not (has_touchdowns and entry.runs.source == "counts" and entry.runs.is_whole())
        for finding in _findings(f"{entry.runs.source} {entry.runs.variant}".rstrip(":"), [entry])
    ]
    named = {e.runs.variant for e in others if e.runs.source == "counts"}
    return SafetyCase(
        program,
        tuple(artefacts),
        tuple(sorted(judged, key=lambda e: (states.index(e.state), severities.index(e.hazard.severity)))),
        tuple(measures),
        tuple(unlinked),
        _equal_counts(artefacts, program),
        tuple(sorted(name for name in named if not name.endswith(":"))),
        ledger.repeated,
        ledger.left_out,
    )


def _equal_counts(artefacts: Sequence[Artefact], program: str) -> tuple[tuple[int, str, int, str], ...]:
    """Return the counts of this version by two tools with equal seeds, environment, flights and outcomes."""
    first: dict[object, tuple[int, str]] = {}
    found = []
    for k, artefact in enumerate(artefacts):
        if artefact.kind != "counts" or program not in artefact.programs():
            continue
        flights = next(runs for runs in artefact.runs if runs.is_whole())
        landed = sum(runs.runs for runs in artefact.runs if runs.source == "touchdowns")
        tool = flights.variant.rstrip(":")
        same = (tuple(sorted(flights.seeds)), flights.environment, flights.runs, landed, flights.unsafe)
        before, other = first.setdefault(same, (k, tool))
        if other != tool:
            found.append((before, other, k, tool))
    return tuple(found)


def _judged(hazard: Hazard, ledger: Ledger) -> HazardEvidence:
    findings = tuple(f for label, entries in _links(hazard, ledger) for f in _findings(label, entries))
    if any(f.unsafe for f in findings):
        state = State.UNSAFE
    elif any(f.failures for f in findings):
        state = State.FAILED
    elif not any(f.runs for f in findings):
        state = State.NONE
    else:
        state = State.SHOWN if all(f.runs for f in findings) else State.PARTIAL
    return HazardEvidence(hazard, state, findings)


def _links(hazard: Hazard, ledger: Ledger) -> list[tuple[str, list[Entry]]]:
    """Return the evidence that a hazard asks for, with its runs; counts only where there are some."""
    tests = ledger.entries("test")
    links = [(node, [e for e in tests if _is_of(e.runs.variant, node)]) for node in hazard.tests]
    for source in ("campaign", "landings", "fuzz", "soak"):
        links += [(f"{source} {name}", ledger.entries(source, name)) for name in getattr(hazard, source)]
    links += [(name, ledger.entries(name)) for name in hazard.measures]
    names = {hazard.id, *hazard.counts, *hazard.campaign}
    for variant in ledger.variants("counts"):
        tool, _, name = variant.partition(":")
        if name in names:
            links.append((f"{tool} {name}", ledger.entries("counts", variant)))
    return links


def _is_of(variant: str, node: str) -> bool:
    """Return whether a test's case is one of a node: the same file, function, or case."""
    return variant == node or variant.startswith((f"{node}::", f"{node}["))


def _findings(label: str, entries: Sequence[Entry]) -> list[Finding]:
    """Return a finding for each environment, runs that are no random draws apart; one without a run for none.

    A bound needs independent draws: others among them would take it away.
    """
    groups: dict[tuple[str, bool], list[Entry]] = {}
    for entry in entries:
        groups.setdefault((entry.runs.environment, not entry.runs.is_random), []).append(entry)
    if not groups:
        return [_finding(label, SIMULATION, False, [])]
    return [_finding(label, name, not chosen, some) for (name, chosen), some in sorted(groups.items())]


def _finding(label: str, environment: str, is_random: bool, entries: Sequence[Entry]) -> Finding:
    skipped = sum(e.runs.skipped for e in entries)
    runs = sum(e.runs.runs for e in entries) - skipped
    failures, unsafe = sum(e.runs.failures for e in entries), sum(e.runs.unsafe for e in entries)
    named = [e.runs.what for e in entries if e.runs.what]
    if len(named) > MOST_FAILURES:
        named = [*named[:MOST_FAILURES], f"and {len(named) - MOST_FAILURES} more"]
    at_least = any(e.runs.at_least for e in entries)
    is_bounded = is_random and runs > 0 and not at_least
    return Finding(
        label,
        entries[0].runs.source if entries else label.split(" ")[0],
        environment,
        is_random,
        runs,
        failures,
        at_least,
        unsafe,
        skipped,
        upper_bound(failures, runs) if is_bounded else None,
        upper_bound(unsafe, runs) if is_bounded else None,
        tuple(named),
        tuple(sorted({k for e in entries for k in e.artefacts})),
    )


def upper_bound(failures: int, runs: int, confidence: float = CONFIDENCE) -> float:
    """Return the one-sided Clopper-Pearson upper bound of the probability of a failure.

    It is the probability of a failure at which `failures` or fewer of `runs` have the probability
    1 - confidence. Without a failure it is 1 - (1 - confidence)^(1/runs), about 3/runs at 95 %. Without a run
    it is 1: nothing is known.

    Raises
    ------
    ValueError
        The counts or the confidence cannot be.
    """
    if not 0 <= failures <= runs or not 0.0 < confidence < 1.0:
        raise ValueError(f"{failures} failures of {runs} runs at a confidence of {confidence}")
    if failures == runs:
        return 1.0
    return float(betaincinv(failures + 1, runs - failures, confidence))
