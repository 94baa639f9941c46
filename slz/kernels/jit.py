"""Compilation of kernels with Numba: cached, without the GIL, eager where a signature is given.

Numba's cache is invalidated only by the source of the kernel itself. A kernel contains the kernels that it
calls, so a change of their files would go unnoticed. The cache is therefore stamped with all sources that a
kernel is compiled from.
"""

from __future__ import annotations

import functools
import logging
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar, cast

import numba

from slz.kernels.source_stamp import stamp

log = logging.getLogger(__name__)

F = TypeVar("F", bound=Callable[..., Any])
ROOT = Path(__file__).parents[2]
_logged = set[str]()  # modules


def kernel(*signatures: str) -> Callable[[F], F]:
    """Compile a function with Numba; `fastmath` stays off because it disables `isnan`."""

    def decorate(function: F) -> F:
        compiled = numba.njit(cache=True, nogil=True, error_model="numpy")(function)
        _mark(compiled, Path(function.__code__.co_filename))
        if signatures and hasattr(compiled, "compile"):
            for signature in signatures:
                compiled.compile(signature)
            compiled.disable_compile()
        module = function.__module__
        if module not in _logged and getattr(compiled, "stats", None) and compiled.stats.cache_misses:
            _logged.add(module)
            log.info("%s is used for the first time on this computer: its kernels are compiled", module)
        return cast(F, compiled)

    return decorate


def _mark(compiled: Any, path: Path) -> None:
    """Stamp the cache of a kernel with all sources that it is compiled from.

    Numba compares the version before it unpickles the rest, which may name modules that an update has moved.
    """
    index = getattr(getattr(compiled, "_cache", None), "_cache_file", None)
    if index is not None and path.is_file():  # absent with the compiler off, and in a notebook
        index._version = f"{index._version} {_stamp(path).hex()}"


@functools.cache
def _stamp(path: Path) -> bytes:
    return stamp(path, ROOT)
