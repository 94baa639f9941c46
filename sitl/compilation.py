"""Decorator that compiles the simulator's kernels with Numba."""

from __future__ import annotations

import functools
import hashlib
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar, cast

import numba

F = TypeVar("F", bound=Callable[..., Any])
ROOT = Path(__file__).parent


def kernel(signature: object = None) -> Callable[[F], F]:
    """Compile a function with Numba, without the GIL and cached on disk.

    Numba reuses compiled code until the source of the kernel itself changes, but that code contains kernels
    and constants of other modules too. The cache is therefore marked with all sources of the simulator.

    Parameters
    ----------
    signature
        A Numba signature compiles at import (entry points); None compiles at the first call
        (helpers, which are compiled with the entry point that calls them).
        ``fastmath`` is never on: it would let the compiler assume that NaN does not exist.
    """

    def decorate(function: F) -> F:
        compiled: Any = numba.njit(cache=True, nogil=True, error_model="numpy")(function)
        index = getattr(getattr(compiled, "_cache", None), "_cache_file", None)
        if index is not None:  # None if the compiler is disabled
            index._version = f"{index._version} {_stamp()}"  # compared before anything else is read
        if signature is not None and index is not None:
            compiled.compile(signature)
            compiled.disable_compile()
        return cast(F, compiled)

    return decorate


@functools.cache
def _stamp() -> str:
    whole = hashlib.sha256()
    for path in sorted(ROOT.rglob("*.py")):
        whole.update(path.read_bytes())
    return whole.hexdigest()
