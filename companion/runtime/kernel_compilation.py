"""Parallel just-in-time compilation of the kernels at the first start on a computer or after an update."""

from __future__ import annotations

import hashlib
import importlib
import itertools
import logging
import os
import queue
import re
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

ROOT = Path(__file__).parents[2]
FLOWN = ("slz/kernels", "companion/flight")  # folders with kernels of a flight
_OF_KERNELS = runpy.run_path(str(ROOT / "slz" / "kernels" / "source_stamp.py"))  # its package would load all
sources_of: Callable[[Path, Path], dict[Path, bytes]] = _OF_KERNELS["sources_of"]
stamp: Callable[[Path, Path], bytes] = _OF_KERNELS["stamp"]
COMPILED = f"*.py{sys.version_info.major}{sys.version_info.minor}.nbi"  # Numba's index files
EAGER = re.compile(rb"^@kernel$", re.MULTILINE)  # compiled at import; others with their callers
# Folders of `slz/kernels` that not every flight needs.
OF_SOURCE_MODE = frozenset({"paper"})
SELDOM = frozenset({"instruments", "survey"})  # take seconds to compile, at their first use
NO_MORE = frozenset[str]()
MOST_CORES = 4  # half a gigabyte of memory each


def of_mode(mode: str) -> frozenset[str]:
    """Return the folders of kernels that a mode needs besides those of every flight."""
    return OF_SOURCE_MODE if mode == "source" else NO_MORE


def is_first(also: frozenset[str] = NO_MORE) -> bool:
    """Return whether the compiled kernels of a flight are missing or out of date.

    also: folders of kernels checked besides those of every flight.
    """
    if os.environ.get("NUMBA_DISABLE_JIT", "0") not in ("", "0"):
        return False  # nothing is ever compiled
    compiled = _compiled()
    return not all(_is_compiled(path, compiled.get(path.stem, [])) for path in _sources(also))


def is_first_of_simulator() -> bool:
    """Return whether the simulator's compiled kernels are missing or of other sources than it has now."""
    if os.environ.get("NUMBA_DISABLE_JIT", "0") not in ("", "0"):
        return False
    compiled = _compiled()
    sources = {path: path.read_bytes() for path in sorted((ROOT / "sitl").rglob("*.py"))}
    whole = hashlib.sha256()
    for content in sources.values():
        whole.update(content)
    text = whole.hexdigest().encode()  # with which `sitl.compilation` marks its cache
    return not all(
        any(text in index.read_bytes() for index in compiled.get(path.stem, []))
        for path, content in sources.items()
        if EAGER.search(content)
    )


def _compiled() -> dict[str, list[Path]]:
    """Return Numba's index files by the name of the module."""
    found: dict[str, list[Path]] = {}
    for folder in _caches():
        for path in folder.rglob(COMPILED):
            found.setdefault(path.name.partition(".")[0], []).append(path)
    return found


def _is_compiled(source: Path, compiled: list[Path]) -> bool:
    """Return whether a cached kernel is newer than its sources or has the same stamp, as Numba checks it."""
    written = max(path.stat().st_mtime for path in sources_of(source, ROOT))
    if any(path.stat().st_mtime >= written for path in compiled):
        return True
    text = stamp(source, ROOT).hex().encode()
    return any(text in path.read_bytes() for path in compiled)


def compile_kernels(progress: Callable[[int, int], None], also: frozenset[str] = NO_MORE) -> None:
    """Compile the missing kernels, one module per core at a time.

    Errors are ignored here: whoever imports the kernels next compiles what is missing.

    Parameters
    ----------
    progress
        Called by several threads with the number of modules done and the total.
    also
        Folders of kernels compiled besides those of every flight.
    """
    sources = sorted(_sources(also), key=lambda path: -path.stat().st_size)  # longest first
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
    """Compile all kernels, at installation."""
    compile_kernels(lambda *_: None, OF_SOURCE_MODE | SELDOM)
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
    """Replace the package `slz` with an empty one, because importing it would import all kernels first."""
    package = ModuleType("slz")
    package.__path__ = [str(ROOT / "slz")]
    sys.modules["slz"] = package


def _sources(also: frozenset[str] = NO_MORE) -> Iterator[Path]:
    """Return the modules with kernels that are compiled at import."""
    left_out = (OF_SOURCE_MODE | SELDOM) - also
    for path in itertools.chain.from_iterable((ROOT / folder).rglob("*.py") for folder in FLOWN):
        if path.parent.name not in left_out and EAGER.search(path.read_bytes()):
            yield path


def _caches() -> list[Path]:
    """Return Numba's cache folders: beside the sources, or in the user's cache where those are read-only."""
    if own := os.environ.get("NUMBA_CACHE_DIR"):
        return [Path(own)]
    at_home = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "numba"
    return [ROOT / "slz", ROOT / "companion", ROOT / "sitl", at_home]


if __name__ == "__main__":  # child of `compile_kernels`: imports the modules named on stdin, one per line
    _kernels_alone()
    for line in sys.stdin:
        importlib.import_module(line.strip())
        print("done", flush=True)
