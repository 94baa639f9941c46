"""`slz bench`: time of the pipeline on a file of points."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated

import typer
from rich.table import Table

from companion.cli.console import compile_at_first, stdout_console
from companion.cli.options import Json
from companion.runtime import kernel_compilation


def bench(
    points: Annotated[Path, typer.Option(help="File of little-endian float64 t (s), x, y, z (m).")],
    cell_m: Annotated[float, typer.Option(help="Side of a cell, m.")],
    zone_m: Annotated[float, typer.Option(help="Side of the map, m.")],
    min_square_m: Annotated[float, typer.Option(help="Side of the safe square, m.")],
    min_boundary: Annotated[int, typer.Option(help="Boundary points that a zone must have.")],
    mode: Annotated[str, typer.Option(help="source: the paper's rules. default: ours.")] = "default",
    windows: Annotated[int | None, typer.Option(min=1, help="Only so many windows.")] = None,
    as_json: Json = False,
) -> None:
    """Time the pipeline on windows of 1 s of a file of points."""
    compile_at_first(kernel_compilation.of_flight(mode))
    from companion.desk import benchmark

    case = benchmark.Case(points, cell_m, zone_m, min_square_m, min_boundary, mode, windows)
    summary = benchmark.run(case)
    if as_json:
        print(json.dumps(summary))
        return
    shown = Table("", "ms", title=f"{summary['windows']} windows, {summary['points_per_s']:,} points/s")
    for name, ms in {**summary["ms"], **summary["stage_ms"]}.items():
        shown.add_row(name, f"{ms:.3f}")
    stdout_console().print(shown)
