"""The one way kernels are compiled: cached, without the GIL, eager where a signature is given."""

from __future__ import annotations

import logging
from collections.abc import Callable
from typing import Any, TypeVar, cast

import numba

log = logging.getLogger(__name__)

F = TypeVar("F", bound=Callable[..., Any])
_told = set[str]()  # modules


def kernel(*signatures: str) -> Callable[[F], F]:
    """Compile a function with Numba; `fastmath` stays off because it turns `isnan` off."""
    eager = list(signatures) or None

    def decorate(function: F) -> F:
        compiled = numba.njit(eager, cache=True, nogil=True, error_model="numpy")(function)
        module = function.__module__
        if module not in _told and getattr(compiled, "stats", None) and compiled.stats.cache_misses:
            _told.add(module)
            log.info("%s is used for the first time on this computer: its kernels are compiled", module)
        return cast(F, compiled)

    return decorate
