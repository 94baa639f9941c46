"""IDs of a growing zone, with and without the rule that reuses them (SLZ paper, Section 5.3)."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

from companion.desk.figures import save_terrain
from companion.desk.reproduce.reproduction_page import Pictures, Section, Table
from companion.desk.reproduce.scenarios import NO_ID_REUSE, Scenario
from companion.desk.reproduce.source_scenes import run

TEXT = (
    "Figures 13 and 14 of the SLZ paper: one zone seen window by window has six numbers without the rule and "
    "one with it. Distinct numbers over all windows. The source's rule (RR > 0.8 and area > 0.9) misses a "
    "zone that grows by more than a fifth of its boundary in a second; default mode goes by common cells."
)
COLUMNS = ("scene", "windows", "IDs without reuse", "IDs, source's rule", "IDs, default mode")


def section(
    scenarios: Sequence[Scenario], out: Path, surveys: Path, progress: Callable[[str], None]
) -> Section:
    """Run every scenario without reuse, with the source's rule and in default mode."""
    rows: list[tuple[str, ...]] = []
    pictures: list[Pictures] = []
    ids: dict[str, list[int]] = {}
    for scenario in scenarios:
        progress(f"{scenario.name}, IDs")
        runs = {
            "without reuse": run(scenario.case("source", NO_ID_REUSE), surveys)[0],
            "by the source rule": run(scenario.case("source"), surveys)[0],
            "in default mode": run(scenario.case("default"), surveys)[0],
        }
        ids[scenario.name] = [outcome.ids for outcome in runs.values()]
        windows = len(runs["in default mode"].ms)
        rows.append((scenario.name, f"{windows}", *(str(n) for n in ids[scenario.name])))
        files = []
        for name, outcome in runs.items():
            folder = out / outcome.case.folder
            folder.mkdir(parents=True, exist_ok=True)
            files.append(folder / f"ids_{name.replace(' ', '_')}.png")
            save_terrain(
                files[-1],
                outcome.maps,
                "safe",
                f"IDs given {name}: {outcome.ids}",
                outcome.report.zones,
                parameters=outcome.parameters,
            )
        pictures.append((f"{scenario.name}: numbers of one growing zone", files))
    return Section([Table("A zone that grows", TEXT, COLUMNS, rows)], pictures, {"ids": ids})
