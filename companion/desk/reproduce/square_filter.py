"""Zones with and without the filter for room to land (SLZ paper, Section 5.2, Figures 11 and 12)."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

from companion.desk.figures import save_maps, save_terrain
from companion.desk.reproduce.reproduction_page import Pictures, Section, Table
from companion.desk.reproduce.scenarios import MODES, Scenario
from companion.desk.reproduce.source_scenes import CaseOutcome, run

TEXT = (
    "Figures 11 and 12 of the SLZ paper: of six zones in a part of scene 1, a square of 24 m leaves two, the "
    "court of 106 x 73 m and the entrance of 55 x 62 m. Cells of 1 m, for the hill of 10 m; helicopter "
    "profile; without the filter a zone holds one footprint. The source's rules keep each earlier shape of a "
    "zone that grows fast, so they report more zones than there are places; covered: ground in any of them."
)
COLUMNS = (
    "scene, mode",
    "zones without",
    "zones with",
    "covered without, m²",
    "covered with, m²",
    "largest, m",
)


def section(
    scenarios: Sequence[Scenario], out: Path, surveys: Path, progress: Callable[[str], None]
) -> Section:
    """Run every scenario in both modes, without and with the filter."""
    rows: list[tuple[str, ...]] = []
    pictures: list[Pictures] = []
    counts: dict[str, list[int]] = {}
    for scenario in scenarios:
        for mode in MODES:
            progress(f"{scenario.name}, {mode} mode")
            without, _ = run(scenario.case(mode, room=False), surveys)
            found, _ = run(scenario.case(mode), surveys)
            counts[found.case.name] = [len(without.report.zones), len(found.report.zones)]
            rows.append(_row(without, found))
            pictures.append(
                (f"{found.case.name}: without and with room for 24 m", _draw(without, found, out))
            )
    return Section([Table("Room to land", TEXT, COLUMNS, rows)], pictures, {"zones_without_and_with": counts})


def _row(without: CaseOutcome, found: CaseOutcome) -> tuple[str, ...]:
    return (
        found.case.name,
        f"{len(without.report.zones)}",
        f"{len(found.report.zones)}",
        f"{without.covered_m2:.0f}",
        f"{found.covered_m2:.0f}",
        _size(found),
    )


def _size(outcome: CaseOutcome) -> str:
    """Return width and height (m) of the box around the largest zone."""
    if not outcome.report.zones:
        return "none"
    rows, cols = max(outcome.report.zones, key=lambda zone: zone.area_m2).box.shape
    cell = outcome.maps.grid.cell_m
    return f"{cols * cell:.0f} x {rows * cell:.0f}"


def _draw(without: CaseOutcome, found: CaseOutcome, out: Path) -> list[Path]:
    folder = out / found.case.folder
    drawn = save_maps(folder, found.maps, found.report.zones, found.parameters)
    extra = folder / "safe_without_filter.png"
    save_terrain(
        extra,
        without.maps,
        "safe",
        "Without the filter",
        without.report.zones,
        parameters=without.parameters,
    )
    return [*drawn[:-1], extra, drawn[-1]]
