"""Page of tables and pictures, as Markdown and as HTML."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from companion.desk.page_template import render
from companion.desk.reproduce.inclined_planes import SlopeError
from companion.desk.reproduce.source_scenes import PAPER_AREA_ERROR, PAPER_MS, CaseOutcome


@dataclass(frozen=True, slots=True)
class Table:
    """A table: its heading, explanation, column names and rows of text."""

    title: str
    text: str
    columns: tuple[str, ...]
    rows: list[tuple[str, ...]]


Pictures = tuple[str, list[Path]]
"""A heading and its files, which are below the page's folder."""


@dataclass(frozen=True, slots=True)
class Section:
    """Tables and pictures of one part of the reproduction, and its figures for JSON by name."""

    tables: list[Table]
    pictures: list[Pictures]
    figures: dict[str, Any]


def scene_table(outcomes: Sequence[CaseOutcome]) -> Table:
    """Return the table of area errors, SLZ paper, Eq. (20), safety errors and times by scene."""
    rows: list[tuple[str, ...]] = [
        (
            o.case.name,
            f"{o.scores.computed_m2:.0f}",
            f"{o.scores.truth_m2:.0f}",
            f"{o.scores.area_error:.4f}",
            f"{o.case.area_error_limit:.3f}",
            f"{100 * o.scores.false_safe:.4f}",
            f"{100 * o.scores.recall:.1f}",
            f"{o.ms_median:.0f} / {o.ms_max:.0f}",
        )
        for o in outcomes
    ]
    columns = (
        "scene",
        "computed m²",
        "truth m²",
        "Eq. (20)",
        "limit",
        "unsafe called safe, %",
        "safe found, %",
        "ms per 1 s, median / max",
    )
    text = (
        f"The SLZ paper reports Eq. (20) = {PAPER_AREA_ERROR} for the stadium (7078, 8316 and 6654 m²) and "
        f"less than {PAPER_MS:.0f} ms for a second of LiDAR at cells of 1 m. Default mode runs at 0.2 m; "
        "surveys are flown by the simulator, placed with the true pose, and judged against the exact world."
    )
    return Table("Zones against the truth", text, columns, rows)


def slope_table(errors: Sequence[SlopeError]) -> Table:
    """Return the table of slope errors on planes."""
    rows: list[tuple[str, ...]] = [
        (
            f"{e.slope_deg:.0f}°",
            f"{e.gradient_rms_deg:.2f}",
            f"{100 * e.gradient_share:.0f}",
            f"{e.plane_rms_deg:.2f}",
            f"{100 * e.plane_share:.0f}",
        )
        for e in errors
    ]
    return Table(
        "Slope of planes",
        "Cells of 0.2 m, 20 returns per m², 2 cm of noise. Gradient: SLZ paper Eq. 6-9. Plane: default mode.",
        ("true slope", "gradient rms °", "cells with one, %", "plane rms °", "cells with one, %"),
        rows,
    )


def write(folder: Path, sections: Sequence[Section]) -> list[Path]:
    """Write index.md and index.html into a folder: all tables, then all pictures."""
    values = {
        "tables": [table for section in sections for table in section.tables],
        "pictures": [
            (title, [(file.stem, file.relative_to(folder).as_posix()) for file in files])
            for section in sections
            for title, files in section.pictures
        ],
    }
    files = [folder / "index.md", folder / "index.html"]
    for file, kind in zip(files, ("md", "html"), strict=True):
        file.write_text(render(f"reproduce/reproduction.{kind}.j2", **values), "utf-8")
    return files
