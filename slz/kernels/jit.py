"""The one way kernels are compiled: cached, without the GIL, eager where a signature is given."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar, cast

import numba

F = TypeVar("F", bound=Callable[..., Any])


def kernel(*signatures: str) -> Callable[[F], F]:
    """Compile a function with Numba; `fastmath` stays off because it turns `isnan` off."""
    eager = list(signatures) or None

    def decorate(function: F) -> F:
        return cast(F, numba.njit(eager, cache=True, nogil=True, error_model="numpy")(function))

    return decorate
