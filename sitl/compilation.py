"""Decorators that compile the simulator's kernels with Numba."""

from __future__ import annotations

import functools
import hashlib
from collections.abc import Callable
from pathlib import Path
from types import NoneType
from typing import Annotated, Any, TypeVar, cast, get_args, get_origin, get_type_hints

import numba

F = TypeVar("F", bound=Callable[..., Any])
SCALARS = {float: "float64", int: "int64", NoneType: "void"}
ROOT = Path(__file__).parent


def kernel(function: F) -> F:
    """Compile a function at import, for the types in its annotations (`sitl.array_types`).

    It and its parts allocate nothing, so they are compiled without reference counting. Numba would count
    each array of a table at each ray: atomic additions that take as long as the ray.
    """
    compiled = _compiled(function, counted=False)
    if hasattr(compiled, "compile"):  # not with the compiler off
        compiled.compile(_signature(function))
        compiled.disable_compile()
    return cast(F, compiled)


def kernel_part(function: F) -> F:
    """Compile a function that kernels call, for the types of each call; it allocates nothing, as they do.

    It becomes a part of its callers: a call would copy some hundred words of a world's tables.
    """
    return cast(F, _compiled(function, counted=False, forceinline=True))


def kernel_for_any_types(function: F) -> F:
    """Compile a function that may allocate when it is first called, for the types of that call."""
    return cast(F, _compiled(function, counted=True))


def _compiled(function: Callable[..., Any], counted: bool, **options: Any) -> Any:
    """Return a function with Numba's compiler, without the GIL and cached on disk.

    Numba reuses compiled code until the source of the kernel itself changes, but that code contains kernels
    and constants of other modules too. The cache is therefore marked with all sources of the simulator.
    ``fastmath`` is never on: it would let the compiler assume that NaN does not exist.
    """
    options["_nrt"] = counted  # a name that Numba's own types do not have
    compiled = numba.njit(cache=True, nogil=True, error_model="numpy", **options)(function)
    index = getattr(getattr(compiled, "_cache", None), "_cache_file", None)
    if index is not None:  # None if the compiler is disabled
        index._version = f"{index._version} {_stamp()}"  # compared before anything else is read
    return compiled


def _signature(function: Callable[..., Any]) -> str:
    """Return the types in a function's annotations as Numba writes them: result(argument, ...)."""
    *arguments, result = get_type_hints(function, include_extras=True).values()
    return f"{_notation(result)}({', '.join(map(_notation, arguments))})"


def _notation(hint: Any) -> str:
    if get_origin(hint) is tuple:
        return f"Tuple(({', '.join(map(_notation, get_args(hint)))},))"
    if get_origin(hint) is Annotated:
        plain, notation = get_args(hint)
        elements = [_notation(kind) for dtype in get_args(plain)[1:] for kind in get_args(dtype)]
        return str(notation).format(*elements)
    return str(SCALARS.get(hint, hint.__name__))


@functools.cache
def _stamp() -> str:
    whole = hashlib.sha256()
    for path in sorted(ROOT.rglob("*.py")):
        whole.update(path.read_bytes())
    return whole.hexdigest()
