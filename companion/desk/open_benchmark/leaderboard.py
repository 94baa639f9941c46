"""Leaderboard of the benchmark: one page without external parts, Markdown and CSV."""

from __future__ import annotations

import csv
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from companion.desk.open_benchmark.methods import OURS, REFERENCE
from companion.desk.open_benchmark.safe_map_score import FOUND
from companion.desk.page_template import render

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
INTRODUCTION = (
    "A cell is safe if the whole square footprint about it is: slope and relief of the exact surface, water"
    " and wires (ADR 39). Sorted by the share of truly unsafe cells that are called safe; methods that find"
    f" less than {LEAST_FOUND:.0%} of the safe cells come after the others. Bold: the best of those that find"
    " more. Time: "
)


class Cell(NamedTuple):
    """A figure as text, and whether it is the best of its column."""

    text: str
    best: bool = False


Row = tuple[str, list[Cell]]
"""Name of a method, or of a scene and its flight, and its figures."""


def write(out: Path, document: dict[str, Any], scenes: Sequence[dict[str, Any]]) -> list[Path]:
    """Write index.html, leaderboard.md and scenes.csv into a folder."""
    files = [out / name for name in ("index.html", "leaderboard.md", "scenes.csv")]
    values = _values(document)
    table = _scene_table(document, scenes)
    page = render("open_benchmark/leaderboard.html.j2", **values, scene_table=table)
    files[0].write_text(page, "utf-8")
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
    return render("open_benchmark/leaderboard.md.j2", **_values(document))


def _values(document: dict[str, Any]) -> dict[str, Any]:
    """Return the values that both templates show."""
    return {
        "heading": _heading(document),
        "introduction": INTRODUCTION + document["timing"] + ".",
        "notes": _notes(document),
        "figure_columns": FIGURE_COLUMNS,
        "curve_columns": CURVE_COLUMNS,
        "curve_title": CURVE_TITLE,
        "curve_dash": CURVE_DASH,
        "groups": [_group(document, group) for group in groups_of(document)],
        "better": better_than_ours(document) or ["nowhere"],
        "methods": document["methods"],
        "ours": OURS,
        "reference": REFERENCE.name,
    }


def _group(document: dict[str, Any], group: str) -> dict[str, Any]:
    """Return the tables and reliability diagrams of the flights of one label."""
    kinds = kinds_of(document, group)
    return {
        "title": _title(group),
        "figures": _figures(document, group),
        "dashes": _dashes(document, group),
        "curves": _curves(document, group),
        "kinds": kinds,
        "by_kind": _kind_figures(document, group, kinds),
        "reliability": [
            (name, figures["reliability"])
            for name, figures in _ordered(document, group)
            if figures["reliability"]
        ],
    }


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


def _figures(document: dict[str, Any], group: str) -> list[Row]:
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
            wins = name in contest and key in best and figures[key] == best[key] and key != "unknown"
            cells.append(Cell(_percent(figures[key]), wins))
        brier = DASH if figures["brier"] is None else f"{figures['brier']:.4f}"
        rows.append((name, [*cells, Cell(brier), Cell(f"{figures['ms']:.0f}")]))
    return rows


def _dashes(document: dict[str, Any], group: str) -> str:
    """Return the meaning of the dashes among a group's figures, empty without dashes."""
    rows = [figures for _, figures in _ordered(document, group)]
    titles = {**dict(COLUMNS), "brier": "Brier"}
    reasons = [
        f"{titles[key].removesuffix(', %')}: {reason}"
        for key, reason in NO_FIGURE.items()
        if any(figures[key] is None for figures in rows)
    ]
    return f"{DASH}: {'; '.join(reasons)}." if reasons else ""


def _curves(document: dict[str, Any], group: str) -> list[Row]:
    """Return unsafe called safe by methods and shares found."""
    curves = {
        name: [point["unsafe_called_safe"] for point in figures["operating_curve"]]
        for name, figures in _ordered(document, group)
        if figures["operating_curve"]
    }
    least = [min((v for v in at if v is not None), default=None) for at in zip(*curves.values(), strict=True)]
    return [
        (name, [Cell(_percent(v), v is not None and v == best) for v, best in zip(of, least, strict=True)])
        for name, of in curves.items()
    ]


def _kind_figures(document: dict[str, Any], group: str, kinds: Sequence[str]) -> list[Row]:
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
            wins = name in contest and value is not None and value == least
            cells.append(Cell(_percent(value), wins))
        rows.append((name, cells))
    return rows


def _percent(share: float | None) -> str:
    return DASH if share is None else f"{100 * share:.2f}" if share < 0.1 else f"{100 * share:.1f}"


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


def _scene_table(document: dict[str, Any], scenes: Sequence[dict[str, Any]]) -> list[Row]:
    """Return scenes by methods: unsafe called safe and, after a stroke, safe found."""
    names = [method["name"] for method in document["methods"]]
    cells = {(one["scene"], one["flight"], one["method"]): one for one in scenes}
    rows = []
    for scene, flight in dict.fromkeys((one["scene"], one["flight"]) for one in scenes):
        figures = (cells[scene, flight, name] for name in names)
        shares = [f"{_percent(f['unsafe_called_safe'])} / {_percent(f['safe_found'])}" for f in figures]
        rows.append((f"{scene}, {flight}", [Cell(share) for share in shares]))
    return rows
