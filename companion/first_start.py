"""The first start on a computer, or after an update: kernels are compiled, by all cores, and kept."""

from __future__ import annotations

import importlib
import itertools
import logging
import os
import queue
import runpy
import subprocess
import sys
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor, wait
from pathlib import Path
from subprocess import DEVNULL, PIPE
from types import ModuleType
from typing import IO, cast

from params import Parameters

log = logging.getLogger(__name__)

ROOT = Path(__file__).parents[1]
OURS = (
    "fusion/motion",
    "fusion/placement",
    "sensors/livox_points",
    "sensors/ouster_points",
    "sensors/velodyne_points",
    "outputs/sectors",
    "dashboard/small_numbers",
)
_OF_KERNELS = runpy.run_path(str(ROOT / "slz" / "kernels" / "sources.py"))  # its package would load them all
sources_of: Callable[[Path, Path], dict[Path, bytes]] = _OF_KERNELS["sources_of"]
stamp: Callable[[Path, Path], bytes] = _OF_KERNELS["stamp"]
COMPILED = f"*.py{sys.version_info.major}{sys.version_info.minor}.nbi"  # Numba's, of this Python
# Without a kernel compiled by itself.
WITHOUT = frozenset({"__init__", "arctangent", "jit", "record", "relief", "rows", "sources"})
OF_SOURCE_MODE = frozenset({"fuse", "interval", "measure", "search", "stream", "sums"})
# Of some sensors and of surveys: seconds, when they are used.
SELDOM = frozenset({"gather", "gradient", "median", "radar_cells", "unwrap", "velodyne_points", "waveform"})
NO_MORE = frozenset[str]()
MOST_CORES = 4  # half a gigabyte of memory


def of_mode(mode: str) -> frozenset[str]:
    """Return the modules with kernels that a mode needs beside those of every flight."""
    return OF_SOURCE_MODE if mode == "source" else NO_MORE


def is_first(also: frozenset[str] = NO_MORE) -> bool:
    """Tell whether some source of a flight's kernels has nothing compiled, or only what it was before.

    also: names of modules looked at beside those of every flight.
    """
    if os.environ.get("NUMBA_DISABLE_JIT", "0") not in ("", "0"):
        return False  # nothing is ever compiled
    compiled: dict[str, list[Path]] = {}
    for folder in _caches():
        for path in folder.rglob(COMPILED):
            compiled.setdefault(path.name.partition(".")[0], []).append(path)
    return not all(_is_compiled(path, compiled.get(path.stem, [])) for path in _sources(also))


def _is_compiled(source: Path, compiled: list[Path]) -> bool:
    """Tell whether something compiled is newer than its sources, or of the same text: Numba goes by that."""
    kernels = ROOT / "slz" / "kernels"
    written = max(path.stat().st_mtime for path in sources_of(source, kernels))
    if any(path.stat().st_mtime >= written for path in compiled):
        return True
    text = stamp(source, kernels)
    return any(text in path.read_bytes() for path in compiled)


def compile_kernels(progress: Callable[[int, int], None], also: frozenset[str] = NO_MORE) -> None:
    """Compile what is not compiled yet, as many modules at a time as there are cores.

    Whatever goes wrong here is left to whoever imports the kernels next: that compiles what is missing.

    Parameters
    ----------
    progress
        Called with the number of modules done and of all, by several threads.
    also
        Names of modules compiled beside those of every flight.
    """
    sources = sorted(_sources(also), key=lambda path: -path.stat().st_size)  # the longest begin first
    names = [".".join(path.relative_to(ROOT).with_suffix("").parts) for path in sources]
    waiting, count = queue.SimpleQueue[str](), itertools.count(1)
    for name in names:
        waiting.put(name)
    cores = min(MOST_CORES, len(os.sched_getaffinity(0)))
    children: list[subprocess.Popen[str]] = []
    with ThreadPoolExecutor(cores) as threads:
        try:
            work = waiting, lambda: progress(next(count), len(names)), children
            wait([threads.submit(_have_compiled, *work) for _ in range(cores)])
        except BaseException:  # a signal
            for child in children:
                child.terminate()
            raise


def everything() -> None:
    """Compile all there is, for whoever installs the program."""
    compile_kernels(lambda *_: None, OF_SOURCE_MODE | SELDOM)
    importlib.import_module("companion.app")
    importlib.import_module("slz.warm_up").warm_up(Parameters())


def _have_compiled(
    waiting: queue.SimpleQueue[str], done: Callable[[], None], children: list[subprocess.Popen[str]]
) -> None:
    """Give the modules that wait to a process, one after the other."""
    command = [sys.executable, "-m", "companion.first_start"]
    try:
        with subprocess.Popen(command, stdin=PIPE, stdout=PIPE, stderr=DEVNULL, text=True, cwd=ROOT) as child:
            children.append(child)
            asked, told = cast(IO[str], child.stdin), cast(IO[str], child.stdout)
            while True:
                asked.write(waiting.get_nowait() + "\n")
                asked.flush()
                if not told.readline():
                    return
                done()
    except (queue.Empty, OSError) as error:
        log.debug("no more is compiled: %r", error)


def _kernels_alone() -> None:
    """Put an empty package in the place of `slz`, which would import all kernels before the first one."""
    package = ModuleType("slz")
    package.__path__ = [str(ROOT / "slz")]
    sys.modules["slz"] = package


def _sources(also: frozenset[str] = NO_MORE) -> Iterator[Path]:
    left_out = WITHOUT | ((OF_SOURCE_MODE | SELDOM) - also)
    ours = (ROOT / "companion" / f"{name}.py" for name in OURS)
    paths = itertools.chain((ROOT / "slz" / "kernels").glob("*.py"), ours)
    return (path for path in paths if path.stem not in left_out)


def _caches() -> list[Path]:
    """Return where Numba may keep what it compiled: beside the sources, or where those cannot be written."""
    if own := os.environ.get("NUMBA_CACHE_DIR"):
        return [Path(own)]
    at_home = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "numba"
    return [ROOT / "slz", ROOT / "companion", at_home]


if __name__ == "__main__":  # of `compile_kernels`: modules come by name, a line each, and are imported
    _kernels_alone()
    for line in sys.stdin:
        importlib.import_module(line.strip())
        print("done", flush=True)
