"""Safety case as Markdown."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from companion.desk.evidence import case_text
from companion.desk.evidence.hazard_list import assurance_parts
from companion.desk.evidence.safety_case import Finding, HazardEvidence, SafetyCase
from companion.desk.markdown_text import escaped


def case_markdown(case: SafetyCase, made: str) -> str:
    """Return the page as Markdown, failures and missing evidence first."""
    lines = [f"# {case_text.TITLE}", "", f"Program {case.program}; made {made}.", ""]
    lines += [f"- **{escaped(line)}**" for line in case_text.headline(case)] + [""]
    if case.unlinked:
        lines += [f"## {case_text.NOT_NAMED}", "", *_table(case.unlinked), ""]
        lines += [f"- {escaped(text)}" for finding in case.unlinked for text in finding.failures_named] + [""]
    if case.unknown_counts:
        lines += [f"Counts of no hazard of the list: {escaped(', '.join(case.unknown_counts))}.", ""]
    overview = [
        (
            e.hazard.id,
            escaped(e.hazard.title),
            e.hazard.severity.value,
            e.state.value,
            case_text.links(e),
        )
        for e in case.hazards
    ]
    lines += ["## Hazards", "", *_rows(("", "hazard", "severity", "state", "links with runs"), overview), ""]
    lines += ["## Reading", "", *_bullets(case_text.READING), "", "## Hazards, barriers and evidence", ""]
    for each in case.hazards:
        lines += _hazard(each)
    lines += ["## Run-time assurance (ASTM F3269-21)", ""]
    parts = assurance_parts()
    rows = [(p.role.value, escaped(p.name), escaped(p.text), _codes(p.code)) for p in parts]
    lines += _rows(("role", "part", "what it does", "code"), rows)
    lines += ["", case_text.ARCHITECTURE, "", "## Artefacts", ""]
    files = [
        (f"A{k + 1}", escaped(str(a.path)), a.kind, escaped(case_text.version_text(a, case.program)),
         case_text.seeds_of(a), escaped("; ".join(a.notes)), f"`{a.sha256}`")
        for k, a in enumerate(case.artefacts)
    ]  # fmt: skip
    lines += _rows(("", "file", "kind", "runs", "seeds", "notes", "SHA-256"), files) if files else ["None."]
    for line in case_text.repetitions(case):
        lines += ["", line]
    return "\n".join([*lines, "", "## What this does not prove", "", *_bullets(case_text.NOT_PROVEN), ""])


def _hazard(each: HazardEvidence) -> list[str]:
    h = each.hazard
    lines = [f"### {h.id}. {escaped(h.title)}: {each.state.value}", ""]
    lines += [f"- {escaped(text)}" for f in each.findings for text in f.failures_named]
    lines += [f"- Severity: {h.severity.value}. Cause: {escaped(h.cause)}. Effect: {escaped(h.effect)}."]
    if h.presumptions or h.failures:
        presumptions = escaped("; ".join((*h.presumptions, *h.failures)))
        lines.append(f"- Presumption (docs/reactions.md): {presumptions}.")
    lines += [f"- Reaction: {escaped(h.reaction)}.", f"- Barriers: {_codes(h.barriers)}."]
    lines += [f"- Limits: {escaped(h.limits)}"] if h.limits else []
    return [*lines, "", *_table(each.findings), ""]


def _table(findings: Sequence[Finding]) -> list[str]:
    rows = [[escaped(cell) for cell in case_text.row(finding)] for finding in findings]
    return _rows(case_text.COLUMNS, rows)


def _rows(columns: Sequence[str], rows: Iterable[Sequence[str]]) -> list[str]:
    lines = ["| " + " | ".join(columns) + " |", "|" + "---|" * len(columns)]
    return [*lines, *("| " + " | ".join(each) + " |" for each in rows)]


def _bullets(texts: Iterable[str]) -> list[str]:
    return [f"- {text}" for text in texts]


def _codes(names: Iterable[str]) -> str:
    return ", ".join(f"`{name}`" for name in names)
