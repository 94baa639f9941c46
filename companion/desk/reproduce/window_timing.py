"""Processing time per window (SLZ paper, Section 5.5, Figure 17)."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from companion.desk.reproduce.reproduction_page import Section, Table
from companion.desk.reproduce.source_scenes import PAPER_MS, CaseOutcome

TEXT = (
    f"Milliseconds for a window of 1 s. The SLZ paper's Figure 17 stays below {PAPER_MS:.0f} ms in C++ on a "
    "Xeon E5-2650 v4 at cells of 1 m; default mode has cells of 0.2 m here and 200,000 pulses a second. "
    "Times depend on the machine and on what else it does."
)
TICKS_MS = (2, 5, 10, 20, 50, 100, 200, 500, 1000)
COLUMNS = ("scene", "windows", "median", "p99", "greatest", "SLZ paper")


def section(outcomes: Sequence[CaseOutcome], out: Path) -> Section:
    """Plot every window's time, and tabulate median, p99 and maximum beside the source's limit."""
    rows: list[tuple[str, ...]] = [
        (
            outcome.case.name,
            f"{len(outcome.ms)}",
            f"{outcome.ms_median:.0f}",
            f"{outcome.ms_p99:.0f}",
            f"{outcome.ms_max:.0f}",
            f"< {PAPER_MS:.0f}",
        )
        for outcome in outcomes
    ]
    file = out / "time_per_window.png"
    _draw(outcomes, file)
    table = Table("Time per window", TEXT, COLUMNS, rows)
    return Section([table], [("Time per window", [file])], {})


def _draw(outcomes: Sequence[CaseOutcome], file: Path) -> None:
    from matplotlib import colormaps
    from matplotlib.figure import Figure
    from matplotlib.ticker import NullFormatter

    figure = Figure(figsize=(10.0, 5.0), dpi=130, layout="constrained")
    axes = figure.add_subplot()
    for number, outcome in enumerate(outcomes):
        colour = colormaps["tab10"](number % 10)
        windows = np.arange(1, len(outcome.ms) + 1)
        axes.plot(windows, outcome.ms, linewidth=1.1, color=colour, label=outcome.case.name)
    axes.axhline(PAPER_MS, color="black", linestyle="--", linewidth=1.2, label="SLZ paper, at most")
    axes.set_yscale("log")
    every = np.concatenate([outcome.ms for outcome in outcomes])
    axes.set_ylim(min(2.0, 0.8 * every.min()), max(1000.0, 1.2 * every.max()))
    axes.set_yticks(TICKS_MS, [f"{tick}" for tick in TICKS_MS])
    axes.yaxis.set_minor_formatter(NullFormatter())
    axes.set_title("Time per window of 1 s", loc="left", fontsize=13, fontweight="bold")
    axes.set_xlabel("window", fontsize=9)
    axes.set_ylabel("ms", fontsize=9)
    axes.grid(alpha=0.3, which="both", linewidth=0.5)
    axes.tick_params(labelsize=8)
    figure.legend(loc="outside lower center", ncols=4, fontsize=8, frameon=False)
    figure.savefig(file, bbox_inches="tight", pad_inches=0.15)
