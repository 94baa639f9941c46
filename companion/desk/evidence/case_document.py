"""Safety case as a JSON document."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

from companion.desk.evidence.binomial_bound import CONFIDENCE
from companion.desk.evidence.case_text import headline, seeds_of, version_text
from companion.desk.evidence.hazard_list import assurance_parts
from companion.desk.evidence.safety_case import Finding, HazardEvidence, SafetyCase, State


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
