"""`slz benchmark`: safe maps of any system against exact truth."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.table import Table

from companion.cli.console import progress, set_up_logging, stdout_console
from companion.cli.options import Json, Verbose
from companion.runtime import extras
from companion.runtime.errors import UsageError


def benchmark(
    out: Annotated[Path | None, typer.Option(help="Folder for the leaderboard, or for --export.")] = None,
    method: Annotated[
        list[str], typer.Option(help="Only this method: its name or a part that no other has (--list).")
    ] = [],  # noqa: B006
    method_file: Annotated[
        list[Path], typer.Option(help="Python file with a METHOD of your own (docs/benchmark/safe-maps.md).")
    ] = [],  # noqa: B006
    only: Annotated[list[str], typer.Option(help="Only scenes whose name holds this (--list).")] = [],  # noqa: B006
    density: Annotated[
        list[int], typer.Option(min=1, max=1000, help="Pulses per m².", show_default="10, 20 and 100")
    ] = [],  # noqa: B006
    scenes: Annotated[
        list[Path], typer.Option(help="Folder of scenes in the exchange format, in place of the frozen ones.")
    ] = [],  # noqa: B006
    laz: Annotated[
        list[Path], typer.Option(help="Classified LAS or LAZ file as a scene, in place of the frozen ones.")
    ] = [],  # noqa: B006
    crs: Annotated[str | None, typer.Option(help="CRS of --laz files that name none.")] = None,
    export: Annotated[bool, typer.Option("--export", help="Write clouds, poses and truth to --out.")] = False,
    cloud_format: Annotated[
        str | None,
        typer.Option("--format", metavar="laz|pcd", help="Of exported clouds.", show_default="laz"),
    ] = None,
    score: Annotated[
        Path | None, typer.Option(help="Score this safe map (.tif) or these zones (.geojson) on --scene.")
    ] = None,
    scene: Annotated[list[str], typer.Option(help="Name of the scene that --score is of (--list).")] = [],  # noqa: B006
    safe_from: Annotated[
        float | None,
        typer.Option(
            help="Least probability that --score FILE.tif calls safe, above 0 and at most 1.",
            show_default="0.5",
        ),
    ] = None,
    names: Annotated[bool, typer.Option("--list", help="Name scenes and methods.")] = False,
    as_json: Json = False,
    verbose: Verbose = False,
) -> None:
    """Judge landing methods, or one map of any program, by how often unsafe ground is called safe."""
    extras.require("survey", "slz benchmark")
    from companion.desk.open_benchmark import benchmark_run
    from companion.desk.open_benchmark.exchange_folder import CLOUD_FORMATS
    from companion.desk.open_benchmark.frozen_scenes import DENSITIES

    densities = tuple(dict.fromkeys(density)) or DENSITIES
    choice = benchmark_run.BenchmarkChoice(
        tuple(method), tuple(method_file), tuple(only), densities, tuple(scenes), tuple(laz), crs
    )
    own = {"--method": method, "--method-file": method_file}
    chosen = {"--only": only, "--density": density}
    others = {"--scenes": scenes, "--laz": laz, "--crs": crs}
    of_export = {"--export": export, "--format": cloud_format}
    of_score = {"--score": score, "--scene": scene, "--safe-from": safe_from}
    if names:
        _refuse("--list", {"--out": out, **own, **chosen, **others, **of_export, **of_score})
        _show_names(as_json)
        return
    if crs is not None and not laz:
        raise UsageError("--crs goes with --laz FILE: other scenes name their CRS themselves")
    if score is not None:
        _refuse("--score", {"--out": out, **of_export, **own, **chosen})
        if len(scene) != 1:
            needed = "one --scene NAME" if scene else "--scene NAME"
            raise UsageError(f"--score FILE goes with {needed}: slz benchmark --list names the scenes")
        _show_score(benchmark_run.score_file(score, scene[0], choice, safe_from), as_json)
        return
    if scene:
        raise UsageError("--scene NAME goes with --score FILE: --only WORD chooses scenes of a run")
    if safe_from is not None:
        raise UsageError("--safe-from goes with --score FILE: a method of a run sets its own limit")
    if out is None:
        raise UsageError("--out DIR is needed: the folder of the leaderboard, or of --export")
    if density and (scenes or laz) and not only:
        raise UsageError("--density is of the frozen scenes: --scenes and --laz have flights of their own")
    if cloud_format not in (None, *CLOUD_FORMATS):
        raise UsageError(f"--format {cloud_format!r}: use laz or pcd")
    if export:
        _refuse("--export", own)
        with progress(as_json) as step:
            written = benchmark_run.export(out, step, choice, cloud_format or CLOUD_FORMATS[0])
        n = len(written["scenes"])
        line = f"{n} scene{'' if n == 1 else 's'}, {written['files']} files in {out}"
        if written["not_as_frozen"]:
            line += f"; not as frozen on this machine: {', '.join(written['not_as_frozen'])}"
        _say(written, as_json, line)
        return
    if cloud_format is not None:
        raise UsageError("--format goes with --export: a run of methods writes no clouds")
    set_up_logging(verbose)
    with progress(as_json) as step:
        summary = benchmark_run.run(out, step, choice)
    _say(summary, as_json, f"see {summary['files'][1]}")


def _refuse(command: str, others: dict[str, object]) -> None:
    """Refuse options that a command would ignore."""
    given = [name for name, value in others.items() if not (value is None or value is False or value == [])]
    if given:
        raise UsageError(f"{command} does not go with {' and '.join(given)}: run slz benchmark twice")


def _say(summary: dict[str, Any], as_json: bool, line: str) -> None:
    if as_json:
        print(json.dumps(summary))
    else:
        stdout_console().print(line, highlight=False)


def _show_names(as_json: bool) -> None:
    from companion.desk.open_benchmark.benchmark_case import frozen_names
    from companion.desk.open_benchmark.benchmark_run import names_of
    from companion.desk.open_benchmark.methods import METHODS, REFERENCE

    listed = {"scenes": frozen_names(), "methods": names_of((*METHODS, REFERENCE))}
    if as_json:
        print(json.dumps(listed))
        return
    for name in frozen_names():
        print(name)
    table = Table("method", "source")
    for one in names_of((*METHODS, REFERENCE)):
        table.add_row(one["name"], one["source"])
    stdout_console().print(table)


def _show_score(figures: dict[str, Any], as_json: bool) -> None:
    from companion.desk.open_benchmark.leaderboard import DASH, NO_FIGURE

    if as_json:
        print(json.dumps(figures))
        return
    table = Table("figure", "", title=f"{figures['file']} on {figures['scene']}")
    if figures["as_frozen"] is not None:
        table.add_row("as frozen", "yes" if figures["as_frozen"] else "no: the scene differs on this machine")
    for key in ("judged", "unsafe"):
        table.add_row(key, str(figures[key]))
    for key in ("unsafe_called_safe", "safe_is_unsafe", "safe_found", "unknown", "brier"):
        value = figures[key]
        table.add_row(key.replace("_", " "), f"{DASH} {NO_FIGURE[key]}" if value is None else f"{value:.4f}")
    for kind, of in figures["by_kind"].items():
        table.add_row(f"unsafe called safe, {kind}", f"{of['unsafe_called_safe']:.4f}")
    stdout_console().print(table)
