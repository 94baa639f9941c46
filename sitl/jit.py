"""The one place where the simulator turns a function into machine code."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar, cast

import numba

F = TypeVar("F", bound=Callable[..., Any])


def kernel(signature: object = None) -> Callable[[F], F]:
    """Compile a function with Numba, without the GIL and cached on disk.

    Parameters
    ----------
    signature
        A Numba signature compiles at import (entry points); None compiles at the first call
        (helpers, which are compiled with the entry point that calls them).
        ``fastmath`` is never on: it would let the compiler assume that NaN does not exist.
    """

    def decorate(function: F) -> F:
        compile_with: Any = numba.njit
        return cast(F, compile_with(signature, cache=True, nogil=True, error_model="numpy")(function))

    return decorate
