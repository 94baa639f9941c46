"""Safety case as one HTML page that prints well and loads nothing."""

from __future__ import annotations

import html
from collections.abc import Iterable, Sequence

from companion.desk.evidence import case_text
from companion.desk.evidence.case_text import NOT_COUNTED
from companion.desk.evidence.hazard_list import assurance_parts
from companion.desk.evidence.safety_case import Finding, HazardEvidence, SafetyCase, State

STYLE = """
@page{size:A4;margin:14mm 12mm}
body{font:14px/1.45 sans-serif;max-width:64em;margin:2em auto;padding:0 1em;color:#111;background:#fff}
h1{font-size:1.6em}h2{margin-top:1.8em;border-bottom:2px solid #333}
h3{font-size:1.05em;margin:0 0 .4em}
table{border-collapse:collapse;width:100%;font-size:.86em;margin:.4em 0}
td,th{border:1px solid #aaa;padding:.2em .45em;text-align:left;vertical-align:top}
td:nth-child(2),td:last-child,table.evidence td:first-child{overflow-wrap:anywhere}
th{background:#eee}td.n{text-align:right;white-space:nowrap}
table.evidence{table-layout:fixed}table.evidence th:first-child{width:36%}
table.evidence th:nth-child(2){width:13%}table.evidence th:last-child{width:10%}
code{font-size:.92em;overflow-wrap:anywhere}
.hazard{border:1px solid #888;border-left:6px solid #888;padding:.6em .8em;margin:.8em 0}
.hazard{break-inside:avoid-page}
.unsafe,.failed{border-left-color:#b00020}.none{border-left-color:#8a4b00}
.part{border-left-color:#a08000}.shown{border-left-color:#2b6e2b}
.badge{float:right;border:1px solid;padding:.05em .5em;font-weight:bold;font-size:.86em}
.unsafe .badge,.failed .badge{color:#fff;background:#b00020}.none .badge{color:#fff;background:#8a4b00}
.part .badge{color:#5c4a00}.shown .badge{color:#2b6e2b}
tr.bad td{background:#fbdde1;font-weight:bold}tr.missing td{background:#fdf0dc}
dl{margin:.2em 0;display:grid;grid-template-columns:8em 1fr;gap:.1em .6em}dt{color:#555}dd{margin:0}
.wrong{color:#b00020;font-weight:bold}.summary li{font-weight:bold}
@media print{body{font-size:10.5px;margin:0;max-width:none;padding:0}h2{break-after:avoid}
*{-webkit-print-color-adjust:exact;print-color-adjust:exact}}
"""
CLASSES = {
    State.UNSAFE: "unsafe",
    State.FAILED: "failed",
    State.NONE: "none",
    State.PARTIAL: "part",
    State.SHOWN: "shown",
}
BAD = (State.UNSAFE, State.FAILED, State.NONE)


def case_page(case: SafetyCase, made: str) -> str:
    """Return the page, failures and missing evidence first."""
    e = html.escape
    parts = [
        "<!doctype html><html lang=en><meta charset=utf-8>",
        "<meta name=viewport content='width=device-width,initial-scale=1'>",
        f"<title>{e(case_text.TITLE)}</title><style>{STYLE}</style>",
        f"<h1>{e(case_text.TITLE)}</h1><p>Program <code>{e(case.program)}</code>; made {e(made)}.</p>",
        _list(case_text.headline(case), "summary"),
    ]
    if case.unlinked:
        parts += [
            f"<h2 class=wrong>{case_text.NOT_NAMED}</h2>",
            _evidence(case.unlinked),
        ]
        parts.append(_list([text for f in case.unlinked for text in f.failures_named], "wrong"))
    if case.unknown_counts:
        names = e(", ".join(case.unknown_counts))
        parts.append(f"<p class=wrong>Counts of no hazard of the list: {names}.</p>")
    parts += ["<h2>Hazards</h2>", _overview(case), "<h2>Reading</h2>", _list(case_text.READING)]
    parts += ["<h2>Hazards, barriers and evidence</h2>", *(_hazard(each) for each in case.hazards)]
    rows = [(part.role.value, part.name, part.text, *[", ".join(part.code)]) for part in assurance_parts()]
    parts += [
        "<h2>Run-time assurance (ASTM F3269-21)</h2>",
        _table(("role", "part", "what it does", "code"), rows),
    ]
    parts += [f"<p>{e(case_text.ARCHITECTURE)}</p>", "<h2>Artefacts</h2>", _artefacts(case)]
    parts += ["<h2>What this does not prove</h2>", _list(case_text.NOT_PROVEN)]
    return "\n".join(parts) + "</html>\n"


def _overview(case: SafetyCase) -> str:
    rows = ""
    for each in case.hazards:
        h, kind = each.hazard, "wrong" if each.state in BAD else "ok"
        rows += f"<tr><td><a href='#{h.id}'>{h.id}</a></td><td>{html.escape(h.title)}</td>"
        rows += f"<td>{h.severity.value}</td><td class={kind}>{each.state.value}</td>"
        rows += f"<td class=n>{case_text.links(each)}</td></tr>"
    head = "<th></th><th>hazard</th><th>severity</th><th>state</th><th>links with runs</th>"
    return f"<table><tr>{head}</tr>{rows}</table>"


def _hazard(each: HazardEvidence) -> str:
    e, h = html.escape, each.hazard
    terms = [("Severity", h.severity.value), ("Cause", h.cause), ("Effect", h.effect)]
    if h.presumptions or h.failures:
        terms.append(("Presumption", "; ".join((*h.presumptions, *h.failures))))
    terms += [("Reaction", h.reaction), ("Barriers", ", ".join(h.barriers))]
    terms += [("Limits", h.limits)] if h.limits else []
    wrong = [text for finding in each.findings for text in finding.failures_named]
    badge = f"<span class=badge>{each.state.value}</span>"
    listed = "".join(f"<dt>{name}<dd>{e(text)}" for name, text in terms)
    return (
        f"<section class='hazard {CLASSES[each.state]}' id='{h.id}'>{badge}<h3>{h.id}. {e(h.title)}</h3>"
        f"{_list(wrong, 'wrong') if wrong else ''}<dl>{listed}</dl>{_evidence(each.findings)}</section>"
    )


def _evidence(findings: Sequence[Finding]) -> str:
    e = html.escape
    lines = []
    for finding in findings:
        state = "bad" if finding.failures else "" if finding.runs else "missing"
        label, environment, *numbers, artefacts = (e(cell) for cell in case_text.row(finding))
        cells = "".join(f"<td class=n>{cell}</td>" for cell in numbers)
        lines.append(
            f"<tr class='{state}'><td>{label}</td><td>{environment}</td>{cells}<td>{artefacts}</td></tr>"
        )
    head = "".join(f"<th>{e(name)}</th>" for name in case_text.COLUMNS)
    return f"<table class=evidence><tr>{head}</tr>{''.join(lines)}</table>"


def _artefacts(case: SafetyCase) -> str:
    if not case.artefacts:
        return "<p class=wrong>None.</p>"
    rows = [
        (f"A{k + 1}", str(a.path), a.kind, case_text.version_text(a, case.program), case_text.seeds_of(a),
         "; ".join(a.notes), a.sha256)
        for k, a in enumerate(case.artefacts)
    ]  # fmt: skip
    table = _table(("", "file", "kind", "runs", "seeds", "notes", "SHA-256"), rows)
    return table + "".join(f"<p>{html.escape(line)}</p>" for line in case_text.repetitions(case))


def _table(columns: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    e = html.escape
    head = "".join(f"<th>{e(name)}</th>" for name in columns)
    body = ""
    for each in rows:
        cells = (f"<td{' class=wrong' * (NOT_COUNTED in cell)}>{e(cell)}</td>" for cell in each)
        body += f"<tr>{''.join(cells)}</tr>"
    return f"<table><tr>{head}</tr>{body}</table>"


def _list(texts: Iterable[str], name: str = "") -> str:
    return f"<ul class='{name}'>" + "".join(f"<li>{html.escape(text)}" for text in texts) + "</ul>"
