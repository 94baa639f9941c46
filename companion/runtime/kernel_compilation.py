"""Parallel just-in-time compilation of the kernels at the first start on a computer or after an update."""

from __future__ import annotations

import gc
import hashlib
import importlib
import itertools
import logging
import math
import os
import queue
import re
import runpy
import subprocess
import sys
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor, wait
from pathlib import Path
from subprocess import DEVNULL, PIPE
from typing import IO, cast

from params import Parameters

log = logging.getLogger(__name__)

ROOT = Path(__file__).parents[2]
_OF_KERNELS = runpy.run_path(str(ROOT / "slz" / "kernels" / "source_stamp.py"))  # its package loads Numba
sources_of: Callable[[Path, Path], dict[Path, bytes]] = _OF_KERNELS["sources_of"]
stamp: Callable[[Path, Path], bytes] = _OF_KERNELS["stamp"]
KERNEL = re.compile(r"^@kernel(?:  #.*)?\ndef (\w+)", re.MULTILINE)  # of every flight
OF_SOURCE_MODE = re.compile(KERNEL.pattern.replace("@kernel", "@kernel(?:_of_source_mode)?"), re.MULTILINE)
ALL = re.compile(KERNEL.pattern.replace("@kernel", "@kernel(?:_of_source_mode|_at_call)?"), re.MULTILINE)
COMPILED = f"*.py{sys.version_info.major}{sys.version_info.minor}.nbi"  # Numba's index files
FLOWN = ("slz/kernels", "companion/flight")  # folders with kernels of a flight
# Folders and modules that few flights need; they take seconds to compile, at their first use.
SELDOM = frozenset({"instruments", "survey", "paper", "odometry", "ouster_points", "velodyne_points"})
MOST_CORES = 4  # half a gigabyte of memory each

# Kernels that `slz map` calls, by module of `slz/kernels`; another one is compiled at its first call.
OF_SURVEY = {
    "air/corridor_obstacles": "clear_over",
    "cells/cell_statistics": "expected_maximum summarise",
    "footprint/derive_maps": "derive_box",
    "footprint/patch": "rows_of_patch",
    "points/histogram": "ends_of",
    "polygons/boundary_tracing": "boundary_rings corner_indices squares trace_boundary",
    "polygons/inner_simplification": "simplify_inside",
    "raster/connected_components": "components put_without_small_parts",
    "raster/distance_transform": "greatest_clearance largest_square most_certain",
    "raster/morphology": "above closed complement dilated enclosed eroded erode_to_side exceeds "
    "minimum_filter",
    "raster/region_fill": "fill",
    "raster/zonal_sums": "common zonal_sums",
    "raster/zone_views": "heights_at sure_clearance zone_obstacles",
    "surface/level_extents": "add_coarse coarser extents_of",
    "surface/raised_plateaus": "penetration raised_plateaus",
    "surface/smooth_planes": "smooth_planes",
    "surface/water_returns": "dark_returns specular_returns vanishing_returns",
    "surface/weights_of_evidence": "decide weigh",
    "survey/point_binning": "by_block count_heights count_lines count_squares evidence_of join place",
    "survey/surface_sums": "add_sums count_apart",
}

Needs = dict[Path, list[str]]  # modules, and names of their kernels


def of_flight(mode: str = "default") -> Needs:
    """Return the kernels that every flight in a mode loads."""
    if mode == "source":
        return _kernels_in(FLOWN, SELDOM - {"paper"}, OF_SOURCE_MODE)
    return _kernels_in(FLOWN, SELDOM)


def of_survey(mode: str = "default") -> Needs:
    """Return the kernels that `slz map` calls, in source mode those that it loads."""
    if mode == "source":
        return of_flight(mode) | _kernels_in(("slz/kernels/survey",))
    return {ROOT / "slz" / "kernels" / f"{name}.py": names.split() for name, names in OF_SURVEY.items()}


def of_simulator() -> Needs:
    """Return the kernels of the simulator that are compiled at their import."""
    return _kernels_in(("sitl",))


def is_first(needs: Needs) -> bool:
    """Return whether compiled kernels are missing or out of date."""
    if os.environ.get("NUMBA_DISABLE_JIT", "0") not in ("", "0"):
        return False  # nothing is ever compiled
    compiled, of_sitl = _compiled(), _stamp_of_simulator()
    return not all(_are_compiled(path, names, compiled, of_sitl) for path, names in needs.items())


def _compiled() -> dict[tuple[str, str], list[Path]]:
    """Return Numba's index files by the names of module and kernel."""
    found: dict[tuple[str, str], list[Path]] = {}
    for folder in _caches():
        for path in folder.rglob(COMPILED):
            module, _, kernel = path.name.partition(".")
            found.setdefault((module, kernel.partition("-")[0]), []).append(path)
    return found


def _are_compiled(
    source: Path, names: list[str], compiled: dict[tuple[str, str], list[Path]], of_sitl: bytes
) -> bool:
    """Return whether each kernel is cached with the stamp of its sources, as Numba checks it."""
    if ROOT / "sitl" in source.parents:
        written, text = math.inf, of_sitl
    else:
        written = max(path.stat().st_mtime for path in sources_of(source, ROOT))
        text = stamp(source, ROOT).hex().encode()
    return all(
        any(
            path.stat().st_mtime >= written or text in path.read_bytes()
            for path in compiled.get((source.stem, name), [])
        )
        for name in names
    )


def _stamp_of_simulator() -> bytes:
    """Return the hash of all sources with which `sitl.compilation` marks its cache."""
    whole = hashlib.sha256()
    for path in sorted((ROOT / "sitl").rglob("*.py")):
        whole.update(path.read_bytes())
    return whole.hexdigest().encode()


def compile_kernels(progress: Callable[[int, int], None], needs: Needs) -> None:
    """Compile the missing kernels, one module per core at a time.

    Errors are ignored: the next caller compiles the missing kernels.

    Parameters
    ----------
    progress
        Called by several threads with the number of modules done and the total.
    """
    sources = sorted(needs, key=lambda path: -path.stat().st_size)  # longest first
    waiting, count = queue.SimpleQueue[str](), itertools.count(1)
    for path in sources:
        waiting.put(" ".join([".".join(path.relative_to(ROOT).with_suffix("").parts), *needs[path]]))
    cores = min(MOST_CORES, len(os.sched_getaffinity(0)))
    children: list[subprocess.Popen[str]] = []
    with ThreadPoolExecutor(cores) as threads:
        try:
            work = waiting, lambda: progress(next(count), len(sources)), children
            wait([threads.submit(_have_compiled, *work) for _ in range(cores)])
        except BaseException:  # a signal
            for child in children:
                child.terminate()
            raise


def everything() -> None:
    """Compile all kernels, at installation."""
    compile_kernels(lambda *_: None, _kernels_in((*FLOWN, "sitl"), kinds=ALL))
    importlib.import_module("companion.flight.app")
    importlib.import_module("slz.warm_up").warm_up(Parameters())


def _have_compiled(
    waiting: queue.SimpleQueue[str], done: Callable[[], None], children: list[subprocess.Popen[str]]
) -> None:
    """Feed waiting module names, one at a time, to a child process that imports them."""
    command = [sys.executable, "-m", "companion.runtime.kernel_compilation"]
    try:
        with subprocess.Popen(command, stdin=PIPE, stdout=PIPE, stderr=DEVNULL, text=True, cwd=ROOT) as child:
            children.append(child)
            questions, answers = cast(IO[str], child.stdin), cast(IO[str], child.stdout)
            while True:
                questions.write(waiting.get_nowait() + "\n")
                questions.flush()
                if not answers.readline():
                    return
                done()
    except (queue.Empty, OSError) as error:
        log.debug("no more is compiled: %r", error)


def _kernels_in(
    folders: tuple[str, ...], but: frozenset[str] = frozenset(), kinds: re.Pattern[str] = KERNEL
) -> Needs:
    """Return the kernels in folders, but those of some modules and folders."""
    paths = sorted(itertools.chain.from_iterable((ROOT / folder).rglob("*.py") for folder in folders))
    kernels = {
        path: kinds.findall(path.read_text("utf-8"))
        for path in paths
        if not but & {path.parent.name, path.stem}
    }
    return {path: names for path, names in kernels.items() if names}


def _caches() -> list[Path]:
    """Return Numba's cache folders: beside the sources, or in the user's cache where those are read-only."""
    if own := os.environ.get("NUMBA_CACHE_DIR"):
        return [Path(own)]
    at_home = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "numba"
    return [ROOT / "slz", ROOT / "companion", ROOT / "sitl", at_home]


if __name__ == "__main__":  # child of `compile_kernels`: a module and its kernels on each line of stdin
    gc.set_threshold(20_000)  # less often: the compiler's objects are many, and few are garbage
    for line in sys.stdin:
        module, *kernels = line.split()
        own = vars(importlib.import_module(module))
        for kernel in kernels:
            if hasattr(own.get(kernel), "compiled"):  # not yet, as those of the simulator are at import
                own[kernel].compiled()
        print("done", flush=True)
