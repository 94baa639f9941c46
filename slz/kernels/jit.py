"""The one way kernels are compiled: eager where a signature is given, cached, without the GIL, no fastmath."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar

import numba

F = TypeVar("F", bound=Callable[..., Any])


def kernel(*signatures: str) -> Callable[[F], F]:
    """Compile a function with Numba; `fastmath` stays off because it turns `isnan` off."""

    def decorate(function: F) -> F:
        compiled: F = numba.njit(list(signatures) or None, cache=True, nogil=True, error_model="numpy")(
            function
        )
        return compiled

    return decorate
