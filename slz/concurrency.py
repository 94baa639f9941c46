"""Concurrent execution of one task beside the caller's own."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from concurrent.futures import Executor, Future, wait
from contextlib import contextmanager
from typing import TypeVar, TypeVarTuple

Args = TypeVarTuple("Args")
R = TypeVar("R")


@contextmanager
def run_concurrently(other: Executor | None, work: Callable[[*Args], R], *args: *Args) -> Iterator[Future[R]]:
    """Run `work` on an executor while the block runs, or after the block if there is none; wait for it.

    Yields the future of its result. An exception in the block wins over one in `work`.
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
