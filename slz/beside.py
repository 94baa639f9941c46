"""Work on another thread while the caller does its own."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from concurrent.futures import Executor, wait
from contextlib import contextmanager
from typing import TypeVarTuple

Args = TypeVarTuple("Args")


@contextmanager
def beside(other: Executor | None, work: Callable[[*Args], object], *args: *Args) -> Iterator[None]:
    """Do work while the block runs, or after it where there is no other thread; it is done when this ends.

    What the block raises goes before what the work raises.
    """
    if other is None:
        yield
        work(*args)
        return
    future = other.submit(work, *args)
    try:
        yield
    finally:
        wait([future])
    future.result()
