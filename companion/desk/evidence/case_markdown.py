"""Safety case as Markdown."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from companion.desk.evidence import case_text
from companion.desk.evidence.hazard_list import assurance_parts
from companion.desk.evidence.safety_case import Finding, HazardEvidence, SafetyCase


def case_markdown(case: SafetyCase, made: str) -> str:
    """Return the page as Markdown, failures and missing evidence first."""
    lines = [f"# {case_text.TITLE}", "", f"Program {case.program}; made {made}.", ""]
    lines += [f"- **{line}**" for line in case_text.headline(case)] + [""]
    if case.unlinked:
        lines += ["## Failures that belong to no hazard of the list", "", *_table(case.unlinked), ""]
        lines += [f"- {text}" for finding in case.unlinked for text in finding.failures_named] + [""]
    if case.unknown_counts:
        lines += [f"Counts of no hazard of the list: {', '.join(case.unknown_counts)}.", ""]
    overview = [
        (
            e.hazard.id,
            e.hazard.title,
            e.hazard.severity.value,
            e.state.value,
            f"{e.with_runs()} of {len(e.findings)}",
        )
        for e in case.hazards
    ]
    lines += ["## Hazards", "", *_rows(("", "hazard", "severity", "state", "links with runs"), overview), ""]
    lines += ["## Reading", "", *_bullets(case_text.READING), "", "## Hazards, barriers and evidence", ""]
    for each in case.hazards:
        lines += _hazard(each)
    lines += ["## Run-time assurance (ASTM F3269-21)", ""]
    rows = [(part.role.value, part.name, part.text, _codes(part.code)) for part in assurance_parts()]
    lines += _rows(("role", "part", "what it does", "code"), rows)
    lines += ["", case_text.ARCHITECTURE, "", "## Artefacts", ""]
    files = [
        (f"A{k + 1}", f"`{a.path}`", a.kind, case_text.version_text(a, case.program), case_text.seeds_of(a),
         "; ".join(a.notes), f"`{a.sha256}`")
        for k, a in enumerate(case.artefacts)
    ]  # fmt: skip
    lines += _rows(("", "file", "kind", "runs", "seeds", "notes", "SHA-256"), files) if files else ["None."]
    for line in case_text.repetitions(case):
        lines += ["", line]
    return "\n".join([*lines, "", "## What this does not prove", "", *_bullets(case_text.NOT_PROVEN), ""])


def _hazard(each: HazardEvidence) -> list[str]:
    h = each.hazard
    lines = [f"### {h.id}. {h.title}: {each.state.value}", ""]
    lines += [f"- {text}" for f in each.findings for text in f.failures_named]
    lines += [f"- Severity: {h.severity.value}. Cause: {h.cause}. Effect: {h.effect}."]
    if h.presumptions or h.failures:
        lines.append(f"- Presumption (docs/reactions.md): {'; '.join((*h.presumptions, *h.failures))}.")
    lines += [f"- Reaction: {h.reaction}.", f"- Barriers: {_codes(h.barriers)}."]
    lines += [f"- Limits: {h.limits}"] if h.limits else []
    return [*lines, "", *_table(each.findings), ""]


def _table(findings: Sequence[Finding]) -> list[str]:
    return _rows(case_text.COLUMNS, [case_text.row(finding) for finding in findings])


def _rows(columns: Sequence[str], rows: Iterable[Sequence[str]]) -> list[str]:
    lines = ["| " + " | ".join(columns) + " |", "|" + "---|" * len(columns)]
    return [*lines, *("| " + " | ".join(cell.replace("|", "\\|") for cell in each) + " |" for each in rows)]


def _bullets(texts: Iterable[str]) -> list[str]:
    return [f"- {text}" for text in texts]


def _codes(names: Iterable[str]) -> str:
    return ", ".join(f"`{name}`" for name in names)
