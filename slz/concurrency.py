"""Work on another thread while the caller does its own."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from concurrent.futures import Executor, Future, wait
from contextlib import contextmanager
from typing import TypeVar, TypeVarTuple

Args = TypeVarTuple("Args")
R = TypeVar("R")


@contextmanager
def beside(other: Executor | None, work: Callable[[*Args], R], *args: *Args) -> Iterator[Future[R]]:
    """Do work while the block runs, or after it where there is no other thread; it is done when this ends.

    Yields what will hold the work's result. What the block raises goes before what the work raises.
    """
    if other is None:
        done: Future[R] = Future()
        yield done
        done.set_result(work(*args))
        return
    future = other.submit(work, *args)
    try:
        yield future
    finally:
        wait([future])
    future.result()
