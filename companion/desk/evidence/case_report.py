"""Safety case as an HTML page, as Markdown and as a JSON document."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import asdict
from functools import partial
from typing import Any

from companion.desk.evidence.artefact_file import Artefact
from companion.desk.evidence.evidence_ledger import SIMULATION, seeds_text
from companion.desk.evidence.hazard_list import assurance_parts
from companion.desk.evidence.safety_case import CONFIDENCE, Finding, HazardEvidence, SafetyCase, State
from companion.desk.page_template import render

NOT_COUNTED = "not counted"
COLUMNS = ("evidence", "kind", "runs", "failed", "≤ at 95 %", "unsafe", "≤ at 95 %", "artefacts")
FLOWN = ("campaign", "landings", "soak", "counts")
MEASURES = {
    "begun": ("landings begun, counted by other tools", "ended unsafe"),
    "touchdowns": ("touchdowns by the companion", "on unsafe ground"),
    "collisions": ("flights not brought down by the pilot or a failsafe", "with a collision"),
    "commands": ("flights", "with a command against the pilot or a failsafe"),
    "by_others": ("flights brought down by the pilot or a failsafe", "on unsafe ground or into something"),
}


def case_page(case: SafetyCase, made: str) -> str:
    """Return one HTML page that prints well and loads nothing, failures and missing evidence first."""
    return render("evidence/case.html.j2", **_values(case, made))


def case_markdown(case: SafetyCase, made: str) -> str:
    """Return the page as Markdown, failures and missing evidence first."""
    return render("evidence/case.md.j2", **_values(case, made))


def case_document(case: SafetyCase, made: str) -> dict[str, Any]:
    """Return the whole case: summary, hazards with their findings, run-time assurance, artefacts."""
    return {
        "format": "slz-evidence",
        "version": 1,
        "program": case.program,
        "made": made,
        "confidence": CONFIDENCE,
        "states": {state.value: case.number(state) for state in State},
        "headline": headline(case),
        "measures": [_finding(each) for each in case.measures],
        "hazards": [_hazard(each) for each in case.hazards],
        "unlinked_failures": [_finding(each) for each in case.unlinked],
        "unknown_counts": list(case.unknown_counts),
        "repeated_runs": dict(case.repeated),
        "left_out_runs": dict(case.left_out),
        "assurance": [{**asdict(part), "role": part.role.value} for part in assurance_parts()],
        "artefacts": [
            {
                "name": f"A{k + 1}",
                "file": str(artefact.path),
                "sha256": artefact.sha256,
                "kind": artefact.kind,
                "runs": {version or "unknown": artefact.count(version) for version in artefact.programs()},
                "counted": version_text(artefact, case.program),
                "seeds": seeds_of(artefact),
                "notes": artefact.notes,
            }
            for k, artefact in enumerate(case.artefacts)
        ],
    }


def _hazard(each: HazardEvidence) -> dict[str, Any]:
    hazard = asdict(each.hazard) | {"severity": each.hazard.severity.value}
    return {**hazard, "state": each.state.value, "findings": [_finding(f) for f in each.findings]}


def _finding(finding: Finding) -> dict[str, Any]:
    return {**asdict(finding), "artefacts": [f"A{k + 1}" for k in finding.artefacts]}


def _values(case: SafetyCase, made: str) -> dict[str, Any]:
    """Return the values that both templates show, and the functions that write their cells."""
    return {
        "case": case,
        "made": made,
        "headline": headline(case),
        "columns": COLUMNS,
        "cells": row,
        "links": links,
        "assurance": assurance_parts(),
        "version_text": partial(version_text, program=case.program),
        "seeds_of": seeds_of,
        "repetitions": repetitions(case),
        "not_counted": NOT_COUNTED,
    }


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


def artefact_names(indices: Sequence[int]) -> str:
    """Return the short names of artefacts, such as "A1, A3"."""
    return ", ".join(f"A{k + 1}" for k in indices)


def links(each: HazardEvidence) -> str:
    """Return the number of a hazard's links that have runs, such as "5 of 6", and counts by other tools."""
    found, asked = each.links()
    counts = each.counts_with_runs()
    return f"{found} of {asked} + {counts} counts" if counts else f"{found} of {asked}"


def repetitions(case: SafetyCase) -> list[str]:
    """Return sentences on runs that were reported more than once, or left out for an overlap."""
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
    """Return the sentence on flights other than real ones, "" where real ones are counted."""
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
    """Return an artefact's numbers of runs by version; only those of this version count."""
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
