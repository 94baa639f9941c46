"""Compilation of kernels with Numba: cached, without the GIL, for the types in their annotations.

Numba's cache is invalidated only by the source of the kernel itself. A kernel contains the kernels that it
calls, so a change of their files would go unnoticed. The cache is therefore stamped with all sources that a
kernel is compiled from.
"""

from __future__ import annotations

import functools
import logging
from collections.abc import Callable
from pathlib import Path
from types import NoneType
from typing import Annotated, Any, TypeVar, cast, get_args, get_origin, get_type_hints

import numba
import numpy as np
from llvmlite import binding
from numba.core.compiler_lock import global_compiler_lock
from numba.core.registry import CPUDispatcher

from slz.kernels.source_stamp import stamp

log = logging.getLogger(__name__)

F = TypeVar("F", bound=Callable[..., Any])
SCALARS = {float: "float64", int: "int64", bool: "boolean", np.bool_: "boolean", NoneType: "void"}
# Without the wrapper for C, which takes seconds of compilation over all kernels; nobody calls it.
OPTIONS: dict[str, Any] = {"cache": True, "nogil": True, "error_model": "numpy", "no_cfunc_wrapper": True}
ROOT = Path(__file__).parents[2]
# LLVM lets two variables on the stack share a place and notes this in the code of the kernel, without the
# larger alignment. Numba compiles that code into the callers of the kernel, which crash on wide lanes.
binding.set_option("slz", "-no-stack-coloring")
_logged = set[str]()  # modules


def kernel(function: F) -> F:
    """Compile a function that flights call, for the types in its annotations (`slz.kernels.argument_types`).

    A type variable with constraints stands for each of them, a compilation each. `load_kernels` compiles it,
    or loads it from the cache, before a flight; later its import does, and elsewhere its first call.
    """
    return _deferred(function, _of_flights)


def kernel_of_source_mode(function: F) -> F:
    """Compile a function that flights in source mode call, as `kernel` does."""
    return _deferred(function, _of_source_mode)


def kernel_at_call(function: F) -> F:
    """Compile a function at its first call because no flight in the default mode calls it."""
    return _deferred(function, [])


def kernel_part(function: F) -> F:
    """Compile a function that only kernels call with the first of these, for the types in its annotations.

    A kernel that comes from the cache contains its parts, which are then neither compiled nor loaded.
    """
    return _deferred(function, [])


def load_kernels(source_mode: bool = False) -> None:
    """Compile or load all imported kernels of flights, so that no first call takes long in flight."""
    global _loads_at_import
    _loads_at_import = True
    for waiting in (_of_flights, _of_source_mode)[: 1 + source_mode]:
        while waiting:
            if isinstance(each := waiting.pop(0), _Uncompiled):  # else called before
                each.compiled()


class _Uncompiled(CPUDispatcher):
    """Numba's dispatcher of a function before its compilation, which the first use causes."""

    def get_call_template(self, args: Any, kws: Any) -> Any:
        return self.compiled().get_call_template(args, kws)

    def __call__(self, *args: Any, **kws: Any) -> Any:
        return self.compiled()(*args, **kws)

    def compiled(self) -> Any:
        with global_compiler_lock:  # else a second thread would call it while it has no types
            if isinstance(self, _Uncompiled):
                _compile(self)
                self.__class__ = CPUDispatcher  # type: ignore[assignment]
        return self


_of_flights, _of_source_mode = list[CPUDispatcher](), list[CPUDispatcher]()  # not loaded yet
_loads_at_import = False


def _deferred(function: F, waiting: list[CPUDispatcher]) -> F:
    compiled = _compiled(function)
    if isinstance(compiled, CPUDispatcher):  # not with the compiler off
        compiled.__class__ = _Uncompiled
        waiting.append(compiled)
        if _loads_at_import and waiting is _of_flights:
            load_kernels()
    return cast(F, compiled)


def _compile(compiled: Any) -> None:
    """Compile a function for the types in its annotations, and for no others."""
    for signature in signatures(compiled.py_func):
        compiled.compile(signature)
    compiled.disable_compile()
    module = compiled.py_func.__module__
    if module not in _logged and compiled.stats.cache_misses:
        _logged.add(module)
        log.info("%s is used for the first time on this computer: its kernels are compiled", module)


def kernel_for_any_types(function: F) -> F:
    """Compile a function when it is first called, by a kernel or otherwise, for the types of that call."""
    return cast(F, _compiled(function))


def signatures(function: Callable[..., Any]) -> list[str]:
    """Return the types in a function's annotations as Numba writes them: result(argument, ...)."""
    *arguments, result = get_type_hints(function, include_extras=True).values()
    text = f"{_notation(result)}({', '.join(map(_notation, arguments))})"
    variables = {variable for hint in arguments for variable in getattr(hint, "__parameters__", ())}
    if not variables:
        return [text]
    (variable,) = variables
    return [text.replace(str(variable), _notation(kind)) for kind in variable.__constraints__]


@functools.cache
def _notation(hint: Any) -> str:
    if get_origin(hint) is tuple:
        return f"Tuple(({', '.join(map(_notation, get_args(hint)))},))"
    if get_origin(hint) is Annotated:
        plain, notation = get_args(hint)
        elements = [_notation(kind) for dtype in get_args(plain)[1:] for kind in get_args(dtype)]
        return str(notation).format(*elements)
    return str(hint) if isinstance(hint, TypeVar) else SCALARS.get(hint, hint.__name__)


def _compiled(function: Callable[..., Any]) -> Any:
    """Return a function with Numba's compiler; `fastmath` stays off because it disables `isnan`."""
    compiled = numba.njit(**OPTIONS)(function)
    _mark(compiled, Path(function.__code__.co_filename))
    return compiled


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
