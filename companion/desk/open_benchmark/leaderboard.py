"""Leaderboard of the benchmark: one page without external parts, Markdown and CSV."""

from __future__ import annotations

import csv
import html
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from companion.desk.markdown_text import escaped
from companion.desk.open_benchmark.methods import OURS, REFERENCE
from companion.desk.open_benchmark.safe_map_score import FOUND

LEAST_FOUND = 0.5
"""Safe ground that a method must find, so that calling nothing safe does not win."""
MARGIN = 0.001  # by which another must be better to be named: less is chance
COLUMNS = (
    ("unsafe_called_safe", "unsafe called safe, %"),
    ("safe_is_unsafe", "of called safe unsafe, %"),
    ("safe_found", "safe found, %"),
    ("unknown", "unknown, %"),
)
DASH = "–"
NO_FIGURE = {
    "unsafe_called_safe": "no cell is unsafe",
    "safe_is_unsafe": "nothing is called safe",
    "safe_found": "no cell is safe",
    "unknown": "no cell is judged",
    "brier": "a map without probabilities",
}
"""Why a figure is None and shown as a dash."""
CURVE_DASH = f"{DASH}: no threshold finds so much. Methods that give a map alone have no threshold to move."
CURVE_TITLE = "Unsafe called safe, %, where the threshold is moved until so much of the safe ground is found"
FIGURE_COLUMNS = ("method", *(title for _, title in COLUMNS), "Brier", "ms")
CURVE_COLUMNS = ("method", *(f"{found:.0%}" for found in FOUND))
STYLE = (
    "body{font:15px/1.5 sans-serif;max-width:75em;margin:2em auto;padding:0 1em;color:#222}"
    "table{border-collapse:collapse;margin:1em 0}td,th{border:1px solid #bbb;padding:.3em .6em}"
    "td,th{text-align:right}"
    "td:first-child,th:first-child{text-align:left}tr.ours{background:#e6f2ec}tr.ref{color:#777}"
    "b{color:#06603a}svg{margin:.5em 1em .5em 0}"
)
TEXT = (
    "A cell is safe if the whole square footprint about it is: slope and relief of the exact surface, water"
    " and wires (ADR 39). Sorted by the share of truly unsafe cells that are called safe; methods that find"
    f" less than {LEAST_FOUND:.0%} of the safe cells come after the others. Bold: the best of those that find"
    " more. Time: "
)


def write(out: Path, document: dict[str, Any], scenes: Sequence[dict[str, Any]]) -> list[Path]:
    """Write index.html, leaderboard.md and scenes.csv into a folder."""
    files = [out / name for name in ("index.html", "leaderboard.md", "scenes.csv")]
    files[0].write_text(_html(document, scenes), "utf-8")
    files[1].write_text(markdown(document), "utf-8")
    kinds = sorted({kind for one in scenes for kind in one["by_kind"]})
    with files[2].open("w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file)
        figures = [name for name, _ in COLUMNS]
        writer.writerow(["scene", "flight", "method", "ms", "judged", "unsafe", *figures, "brier", *kinds])
        for one in scenes:
            of_kinds = [one["by_kind"].get(kind, {}).get("unsafe_called_safe") for kind in kinds]
            plain = [one[name] for name in ("scene", "flight", "method", "ms", "judged", "unsafe")]
            writer.writerow([*plain, *(one[name] for name in figures), one["brier"], *of_kinds])
    return files


def markdown(document: dict[str, Any]) -> str:
    """Return the leaderboard as Markdown."""
    lines = [
        f"# {_heading(document)}",
        "",
        TEXT + document["timing"] + ".",
        "",
    ]
    lines += [escaped(line) for line in _notes(document)]
    for group in groups_of(document):
        lines += ["", f"## {escaped(_title(group))}", ""]
        lines += _table(FIGURE_COLUMNS, _figures(document, group))
        if dashes := _dashes(document, group):
            lines += ["", escaped(dashes)]
        if curves := _curves(document, group):
            lines += ["", CURVE_TITLE + ":", "", *_table(CURVE_COLUMNS, curves), "", escaped(CURVE_DASH)]
        kinds = kinds_of(document, group)
        if kinds:
            lines += ["", "Unsafe called safe by kind of hazard, %:", ""]
            lines += _table(["method", *kinds], _kind_figures(document, group, kinds))
    lines += ["", "## Where another method is better than this project's", ""]
    lines += [f"- {escaped(line)}" for line in better_than_ours(document)] or ["- nowhere"]
    lines += ["", "## Sources", ""] + [
        f"- {escaped(m['name'])}: {escaped(m['source'])}" for m in document["methods"]
    ]
    return "\n".join(lines) + "\n"


def better_than_ours(document: dict[str, Any]) -> list[str]:
    """Return one line for each figure in which another method wins, among those that find enough."""
    lines = []
    for group in groups_of(document):
        contest = _contestants(document, group)
        mine = [m["groups"][group] for m in document["methods"] if m["name"] == OURS and group in m["groups"]]
        ours = mine[0] if mine else None
        others = {name: figures for name, figures in contest.items() if name != OURS}
        if ours is None or not others:
            continue
        for title, own, theirs, sign in _comparisons(ours, others):
            name, best = min(theirs.items(), key=lambda item: sign * item[1])
            if sign * (own - best) > MARGIN:
                lines.append(f"{_title(group)}: {title}: {name} {_percent(best)} %, ours {_percent(own)} %")
        name, fastest = min(((n, f["ms"]) for n, f in others.items()), key=lambda item: item[1])
        if fastest < ours["ms"]:
            lines.append(f"{_title(group)}: time: {name} {fastest:g} ms, ours {ours['ms']:g} ms")
    return lines


def _comparisons(
    ours: dict[str, Any], others: dict[str, dict[str, Any]]
) -> Iterator[tuple[str, float, dict[str, float], int]]:
    """Yield title, our figure, the others' by name, and 1 if less is better, else -1."""
    for key, title in COLUMNS:
        values = {name: figures[key] for name, figures in others.items() if figures[key] is not None}
        if ours[key] is not None and values:
            yield title.removesuffix(", %"), ours[key], values, -1 if key == "safe_found" else 1
    for kind, mine in ours["by_kind"].items():
        values = {
            n: f["by_kind"][kind]["unsafe_called_safe"] for n, f in others.items() if kind in f["by_kind"]
        }
        if values:
            yield f"unsafe called safe, {kind}", mine["unsafe_called_safe"], values, 1


def groups_of(document: dict[str, Any]) -> list[str]:
    """Return the labels of flights, in the order of the run."""
    return list(dict.fromkeys(group for method in document["methods"] for group in method["groups"]))


def kinds_of(document: dict[str, Any], group: str) -> list[str]:
    """Return the kinds of hazard in a group."""
    found = (method["groups"].get(group, {"by_kind": {}})["by_kind"] for method in document["methods"])
    return sorted({kind for kinds in found for kind in kinds})


def _title(group: str) -> str:
    return f"{group} pulses/m²" if group.isdigit() else group


def _contestants(document: dict[str, Any], group: str) -> dict[str, dict[str, Any]]:
    return {
        m["name"]: m["groups"][group]
        for m in document["methods"]
        if group in m["groups"] and m["name"] != REFERENCE.name and _finds_enough(m["groups"][group])
    }


def _finds_enough(figures: dict[str, Any]) -> bool:
    return (figures["safe_found"] or 0.0) >= LEAST_FOUND


def _ordered(document: dict[str, Any], group: str) -> list[tuple[str, dict[str, Any]]]:
    rows = [(m["name"], m["groups"][group]) for m in document["methods"] if group in m["groups"]]

    def place(row: tuple[str, dict[str, Any]]) -> tuple[bool, bool, float, str]:
        name, figures = row
        missed = figures["unsafe_called_safe"] or 0.0
        return name == REFERENCE.name, not _finds_enough(figures), missed, name

    return sorted(rows, key=place)


def _figures(document: dict[str, Any], group: str) -> list[list[str]]:
    contest = _contestants(document, group)
    best: dict[str, float] = {}
    for key, _ in COLUMNS:
        values = [figures[key] for figures in contest.values() if figures[key] is not None]
        if values:
            best[key] = max(values) if key == "safe_found" else min(values)
    rows = []
    for name, figures in _ordered(document, group):
        cells = []
        for key, _ in COLUMNS:
            text = _percent(figures[key])
            wins = name in contest and key in best and figures[key] == best[key] and key != "unknown"
            cells.append(f"**{text}**" if wins else text)
        brier = DASH if figures["brier"] is None else f"{figures['brier']:.4f}"
        rows.append([name, *cells, brier, f"{figures['ms']:.0f}"])
    return rows


def _dashes(document: dict[str, Any], group: str) -> str:
    """Return what the dashes among a group's figures mean, empty where it has none."""
    rows = [figures for _, figures in _ordered(document, group)]
    titles = {**dict(COLUMNS), "brier": "Brier"}
    reasons = [
        f"{titles[key].removesuffix(', %')}: {reason}"
        for key, reason in NO_FIGURE.items()
        if any(figures[key] is None for figures in rows)
    ]
    return f"{DASH}: {'; '.join(reasons)}." if reasons else ""


def _curves(document: dict[str, Any], group: str) -> list[list[str]]:
    """Return unsafe called safe by methods and shares found; the least of each share is bold."""
    curves = {
        name: [point["unsafe_called_safe"] for point in figures["operating_curve"]]
        for name, figures in _ordered(document, group)
        if figures["operating_curve"]
    }
    least = [min((v for v in at if v is not None), default=None) for at in zip(*curves.values(), strict=True)]
    return [
        [
            name,
            *(
                f"**{_percent(v)}**" if v is not None and v == best else _percent(v)
                for v, best in zip(of, least, strict=True)
            ),
        ]
        for name, of in curves.items()
    ]


def _kind_figures(document: dict[str, Any], group: str, kinds: Sequence[str]) -> list[list[str]]:
    contest = _contestants(document, group)
    rows = []
    for name, figures in _ordered(document, group):
        cells = []
        for kind in kinds:
            value = figures["by_kind"].get(kind, {}).get("unsafe_called_safe")
            least = min(
                (f["by_kind"][kind]["unsafe_called_safe"] for f in contest.values() if kind in f["by_kind"]),
                default=None,
            )
            text = _percent(value)
            cells.append(f"**{text}**" if name in contest and value is not None and value == least else text)
        rows.append([name, *cells])
    return rows


def _percent(share: float | None) -> str:
    return DASH if share is None else f"{100 * share:.2f}" if share < 0.1 else f"{100 * share:.1f}"


def _table(columns: Sequence[str], rows: Sequence[Sequence[str]]) -> list[str]:
    """Return a Markdown table; the first of a row is a name, the rest are figures and their emphasis."""
    lines = ["| " + " | ".join(map(escaped, columns)) + " |", "|" + "---|" * len(columns)]
    return lines + ["| " + " | ".join([escaped(row[0]), *row[1:]]) + " |" for row in rows]


def _heading(document: dict[str, Any]) -> str:
    if document["other_scenes"] and not document["frozen_scenes"]:
        return "Safe maps on other scenes than the benchmark's"
    also = ", and other scenes" if document["other_scenes"] else ""
    return f"Benchmark of safe maps, version {document['version']}{also}"


def _notes(document: dict[str, Any]) -> list[str]:
    n, frozen, version = document["scenes"], document["frozen_scenes"], document["version"]
    counted = f"{n} scene{'' if n == 1 else 's'}"
    notes = [f"{counted}, {document['seconds']:.0f} s on {document['machine']}."]
    if 0 < frozen < document["frozen_scenes_of_version"]:
        notes.append(f"{frozen} of the {document['frozen_scenes_of_version']} scenes of version {version}.")
    if document["other_scenes"]:
        names = ", ".join(document["other_scenes"])
        notes.append(f"Other scenes than the frozen ones of version {version}: {names}.")
    if document["not_as_frozen"]:
        notes.append(f"Not as frozen on this machine: {', '.join(document['not_as_frozen'])}.")
    if document["flights_without_digest"]:
        flights = ", ".join(map(_title, document["flights_without_digest"]))
        notes.append(f"Flights whose returns no digest of the manifest freezes: {flights}.")
    return notes


def _html(document: dict[str, Any], scenes: Sequence[dict[str, Any]]) -> str:
    title = _heading(document)
    parts = [
        f"<!doctype html><html lang=en><meta charset=utf-8><title>{title}</title><style>{STYLE}</style>",
        f"<h1>{title}</h1><p>{html.escape(TEXT + document['timing'])}.</p>",
        *(f"<p>{html.escape(note)}</p>" for note in _notes(document)),
    ]
    for group in groups_of(document):
        parts.append(f"<h2>{html.escape(_title(group))}</h2>")
        parts.append(_html_table(FIGURE_COLUMNS, _figures(document, group)))
        if dashes := _dashes(document, group):
            parts.append(f"<p>{html.escape(dashes)}</p>")
        if curves := _curves(document, group):
            table = _html_table(CURVE_COLUMNS, curves)
            parts.append(f"<h3>{CURVE_TITLE}</h3>{table}<p>{html.escape(CURVE_DASH)}</p>")
        if kinds := kinds_of(document, group):
            parts.append("<h3>Unsafe called safe by kind of hazard, %</h3>")
            parts.append(_html_table(["method", *kinds], _kind_figures(document, group, kinds)))
        for name, figures in _ordered(document, group):
            if figures["reliability"]:
                parts.append(_reliability(name, figures["reliability"]))
    wins = better_than_ours(document)
    parts.append("<h2>Where another method is better than this project's</h2><ul>")
    parts += [f"<li>{html.escape(line)}</li>" for line in wins or ["nowhere"]]
    parts.append("</ul><h2>Unsafe called safe by scene, %</h2>")
    parts.append(_scene_table(document, scenes))
    parts.append("<h2>Sources</h2><ul>")
    for method in document["methods"]:
        parts.append(f"<li><b>{html.escape(method['name'])}</b>: {html.escape(method['source'])}</li>")
    return "\n".join(parts) + "</ul></html>\n"


def _scene_table(document: dict[str, Any], scenes: Sequence[dict[str, Any]]) -> str:
    """Return scenes by methods: unsafe called safe and, after a stroke, safe found."""
    names = [method["name"] for method in document["methods"]]
    cells = {(one["scene"], one["flight"], one["method"]): one for one in scenes}
    rows = []
    for scene, flight in dict.fromkeys((one["scene"], one["flight"]) for one in scenes):
        figures = (cells[scene, flight, name] for name in names)
        shares = [f"{_percent(f['unsafe_called_safe'])} / {_percent(f['safe_found'])}" for f in figures]
        rows.append([f"{scene}, {flight}", *shares])
    explained = f"unsafe called safe / safe found; {DASH}: the scene has no unsafe or no safe cell"
    return f"<p>{explained}</p>" + _html_table(["scene, flight", *names], rows)


def _html_table(columns: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    lines = ["<table><tr>", *(f"<th>{html.escape(column)}</th>" for column in columns), "</tr>"]
    for row in rows:
        role = " class=ours" if row[0] == OURS else " class=ref" if row[0] == REFERENCE.name else ""
        lines.append(f"<tr{role}>" + "".join(f"<td>{_cell(cell)}</td>" for cell in row) + "</tr>")
    return "".join(lines) + "</table>"


def _cell(text: str) -> str:
    plain = html.escape(text.strip("*"))
    return f"<b>{plain}</b>" if text.startswith("**") else plain


def _reliability(name: str, bins: Sequence[dict[str, Any]]) -> str:
    """Return a reliability diagram as SVG: probability across, share truly safe up, area by cells."""
    most = max(one["cells"] for one in bins)
    spots = "".join(
        f'<circle cx="{40 + 200 * one["mean"]:.1f}" cy="{220 - 200 * one["truly_safe"]:.1f}"'
        f' r="{2 + 8 * (one["cells"] / most) ** 0.5:.1f}" fill="#06603a" fill-opacity=".6">'
        f"<title>{one['cells']} cells: {one['mean']:.3f} said, {one['truly_safe']:.3f} safe</title></circle>"
        for one in bins
    )
    return (
        f'<svg width="260" height="260" role="img" aria-label="reliability of {html.escape(name)}">'
        '<rect x="40" y="20" width="200" height="200" fill="none" stroke="#bbb"/>'
        f'<path d="M40 220 240 20" stroke="#bbb"/>{spots}'
        f'<text x="40" y="14" font-size="13">{html.escape(name)}</text>'
        '<text x="40" y="236" font-size="11">0</text><text x="232" y="236" font-size="11">1</text>'
        '<text x="70" y="252" font-size="12">probability of safe</text>'
        '<text x="14" y="200" font-size="12" transform="rotate(-90 14 200)">truly safe</text></svg>'
    )
