"""Words and numbers of a safety case that its page and its Markdown share."""

from __future__ import annotations

import math
from collections.abc import Sequence

from companion.desk.evidence.artefact_file import Artefact
from companion.desk.evidence.evidence_runs import SIMULATION, seeds_text
from companion.desk.evidence.safety_case import Finding, HazardEvidence, SafetyCase, State

TITLE = "Evidence for the safety of landings with slz"
NOT_COUNTED = "not counted"
FLOWN = ("campaign", "landings", "soak", "counts")
MEASURES = {
    "begun": ("landings begun, counted by other tools", "ended unsafe"),
    "touchdowns": ("touchdowns by the companion", "on unsafe ground"),
    "collisions": ("flights not brought down by the pilot or a failsafe", "with a collision"),
    "commands": ("flights", "with a command against the pilot or a failsafe"),
    "by_others": ("flights brought down by the pilot or a failsafe", "on unsafe ground or into something"),
}
NOT_NAMED = "Failures in runs that no hazard of the list names"
READING = (
    "Every number is counted from the files listed under Artefacts; nothing is entered by hand. Only runs "
    "of the program version named above count. A run is identified by its kind, variant, seed and version: "
    "reported by several files it counts once, with the worst outcome.",
    "Unsafe: a touchdown on unsafe ground, a collision, or a command against the pilot or a failsafe. "
    "Failed: not as the hazard's reaction requires; unsafe runs are failed runs. With ≥ how many failed is "
    "not known, because the file does not say it, or memory grew over all inputs: there is no bound.",
    "Links with runs: of the tests, flights, inputs and measures that the hazard's list asks for, those that "
    'have a run. Counts by other tools belong to none of them: they are named after "+".',
    "Bound: one-sided upper limit (Clopper-Pearson, 95 %) of the probability in one run; without a failure "
    "about 3/n. It holds for the mixture of scenarios from which the seeds were drawn. Each bound holds by "
    "itself: of many, one in twenty may be too low. Tests, soaks and adaptive searches are no random draws "
    "and have no bound.",
    "All flights marked simulation were flown in this project's own simulator, with the program's own "
    "packets and messages. The simulator's sensors, vehicles and worlds are models.",
)
NOT_PROVEN = (
    "That the vehicle, its autopilot, sensor, mounting or pilot are safe, or that the installation is as "
    "assumed.",
    "Anything about conditions that the simulator or the tests do not contain (docs/limits.md).",
    "The probability of a hazard in operation: bounds hold for simulated mixtures, which are denser in "
    "hazards than operation in some respects and kinder in others.",
    "That the list of hazards is complete, or that barriers are independent: most run in one process on one "
    "computer.",
    "Compliance with ASTM F3269-21 or any regulation. The form follows the standard; assurance levels were "
    "not assigned, and no independent party has reviewed it.",
    "That no file was left out, or that no line was removed before its digest was taken: digests fix the "
    "files named here, as they were given. Gaps in the seeds of an artefact are visible in its row.",
)
ARCHITECTURE = (
    "Departures from the standard's architecture: monitors, switch and complex function are parts of one "
    "program in one language on one computer; the monitors of the ground use the same LiDAR as the function "
    "that they monitor; the recovery functions of the last resort are the autopilot and the pilot."
)


def share(value: float | None) -> str:
    """Return a probability in percent with two digits, rounded up; "-" without one."""
    if value is None:
        return "-"
    if value >= 1.0:
        return "100 %"
    percent = 100 * value
    step = 10.0 ** (math.floor(math.log10(percent)) - 1)
    digits = max(0, -round(math.log10(step)))
    return f"{math.ceil(percent / step - 1e-9) * step:.{digits}f} %"


def row(finding: Finding) -> tuple[str, ...]:
    """Return the cells of a finding: evidence, environment, runs, failed, bound, unsafe, bound, artefacts."""
    environment = (
        "test" if finding.source == "test" or finding.label.startswith("tests/") else finding.environment
    )
    flown = finding.source not in ("test", "fuzz", "soak")
    if finding.source not in ("test", "soak") and finding.runs and not finding.is_random:
        environment += ", not independent"
    skipped = f" ({finding.skipped:,} skipped)" if finding.skipped else ""
    if not (finding.runs or finding.failures):
        return (finding.label, environment, f"no run{skipped}", *["-"] * 4, artefact_names(finding.artefacts))
    return (
        finding.label,
        environment,
        f"{finding.runs:,}{skipped}",
        f"{'≥ ' * finding.at_least}{finding.failures:,}",
        share(finding.failed_bound),
        f"{finding.unsafe:,}" if flown else "-",
        share(finding.unsafe_bound) if flown else "-",
        artefact_names(finding.artefacts),
    )


COLUMNS = ("evidence", "kind", "runs", "failed", "≤ at 95 %", "unsafe", "≤ at 95 %", "artefacts")


def artefact_names(indices: Sequence[int]) -> str:
    """Return the short names of artefacts, such as "A1, A3"."""
    return ", ".join(f"A{k + 1}" for k in indices)


def links(each: HazardEvidence) -> str:
    """Return how many of a hazard's links have runs, such as "5 of 6", and counts by other tools."""
    found, asked = each.links()
    counts = each.counts_with_runs()
    return f"{found} of {asked} + {counts} counts" if counts else f"{found} of {asked}"


def repetitions(case: SafetyCase) -> list[str]:
    """Return what was reported more than once, and what was left out for an overlap."""
    lines = [
        f"{n:,} {unit} were reported more than once and counted once." for unit, n in case.repeated.items()
    ]
    lines += [
        f"{n:,} {unit} were left out, {NOT_COUNTED}: their document has seeds in common with a larger one, "
        "and which of its outcomes belong to the others cannot be told. Failures of the document are counted."
        for unit, n in case.left_out.items()
    ]
    return lines


def headline(case: SafetyCase) -> list[str]:
    """Return the summary: states of the hazards, and the measures over all flights."""
    states = ", ".join(f"{case.number(state)} {state.value}" for state in State)
    lines = [f"{len(case.hazards)} hazards: {states}."]
    if not case.artefacts:
        lines.append("NO EVIDENCE AT ALL: no artefact was given.")
    old = [f"A{k + 1}" for k, a in enumerate(case.artefacts) if a.programs() != [case.program]]
    if old:
        lines.append(f"Runs of another or unknown version, {NOT_COUNTED}: in {', '.join(old)}.")
    for before, other, k, tool in case.equal_counts:
        lines.append(
            f"COUNTED TWICE? Counts of {other} (A{before + 1}) and {tool} (A{k + 1}) are equal, with the "
            "same version, environment and seeds: if they are the same runs, leave one out."
        )
    for finding in case.measures:
        bound = f"; at most {share(finding.unsafe_bound)} at 95 %" if finding.unsafe_bound is not None else ""
        how = "" if finding.is_random else " (not independent)"
        runs, wrong = MEASURES[finding.label]
        lines.append(
            f"{finding.environment}: {finding.runs:,} {runs}{how}, {finding.unsafe:,} {wrong}{bound}."
        )
    if not any(f.label == "touchdowns" for f in case.measures):
        lines.append("NO EVIDENCE of touchdowns.")
    if text := _no_real_flights(case):
        lines.append(text)
    return lines


def _no_real_flights(case: SafetyCase) -> str:
    """Return what was flown instead of real flights, "" where real ones are counted."""
    runs = [r for a in case.artefacts for r in a.runs if r.program == case.program and r.runs]
    flown = {r.environment for r in runs if r.source in FLOWN}
    if "flight" in flown:
        return ""
    if not flown:
        return "No evidence of real flights: no flight was counted."
    if flown == {SIMULATION}:
        return "No evidence of real flights: every flight counted here is simulated."
    return f"No evidence of real flights: those counted here are of {', '.join(sorted(flown))}."


def version_text(artefact: Artefact, program: str) -> str:
    """Return which of an artefact's runs count: those of this version; older and unknown ones are named."""
    texts = []
    for version in artefact.programs():
        count = f"{artefact.count(version):,} runs"
        if version == program:
            texts.append(f"{count} of this version")
        elif version:
            texts.append(f"STALE: {count} of version {version}, {NOT_COUNTED}")
        else:
            texts.append(f"UNKNOWN VERSION: {count}, {NOT_COUNTED}")
    return "; ".join(texts)


def seeds_of(artefact: Artefact) -> str:
    """Return the seeds of an artefact's runs; tests have none."""
    own = [runs for runs in artefact.runs if runs.source == artefact.kind]
    return "" if artefact.kind == "test" else seeds_text(tuple(s for runs in own for s in runs.seeds))
