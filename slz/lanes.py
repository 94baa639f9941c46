"""Lanes: stages of a method in their order, on one thread or two."""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor, wait
from contextlib import contextmanager
from typing import Any, Protocol, TypeVar

T_contra = TypeVar("T_contra", contravariant=True)
On = TypeVar("On")
MAIN, BESIDE = 1, 2


class Stage(Protocol[T_contra]):
    """One step of a method.

    name: of its time in reports. reads, sets: names of what it needs and of what it changes, as
    `slz.stages.STAGES` has them. lane: `BESIDE` for a stage that may run on the second thread, beside later
    ones of the first that share nothing with it.
    """

    name: str
    reads: frozenset[str]
    sets: frozenset[str]
    lane: int

    def run(self, returns: Any, on: T_contra, /) -> None:
        """Work on the rows of a window, and on what it takes besides."""


def conflict(a: Stage[Any], b: Stage[Any]) -> bool:
    """Return whether two stages must run one after the other."""
    return bool(a.sets & (b.reads | b.sets) or a.reads & b.sets)


def unmet(stages: Sequence[Stage[Any]], given: frozenset[str]) -> dict[str, frozenset[str]]:
    """Return what stages read that is neither given nor set by one before, by their names."""
    out, known = {}, given
    for stage in stages:
        if missing := stage.reads - known:
            out[stage.name] = missing
        known = known | stage.sets
    return out


class Lanes:
    """Runs stages: with a second thread, those of the lane `BESIDE` on it. The results are the same.

    Parameters
    ----------
    threads
        1 or 2.
    """

    def __init__(self, threads: int) -> None:
        self._other = ThreadPoolExecutor(1, "slz-second-lane") if threads == 2 else None

    def run(self, stages: Sequence[Stage[On]], returns: Any, on: On, ms: dict[str, float]) -> None:
        """Run stages in their order, and add the time that each took to `ms`.

        Of a stage on the second thread it is the time for which the first waited.

        Raises
        ------
        Exception
            The first of any stage, after those that run have ended.
        """
        beside: dict[Stage[On], Future[None]] = {}
        try:
            for stage in stages:
                if stage.lane == BESIDE and self._other is not None:
                    beside[stage] = self._other.submit(stage.run, returns, on)
                    continue
                for other in [other for other in beside if conflict(other, stage)]:
                    with timed(other.name, ms):
                        beside.pop(other).result()
                with timed(stage.name, ms):
                    stage.run(returns, on)
            for other, future in beside.items():
                with timed(other.name, ms):
                    future.result()
        finally:
            wait(beside.values())


@contextmanager
def timed(name: str, ms: dict[str, float]) -> Iterator[None]:
    """Add the milliseconds that the block takes to those of a name."""
    start = time.perf_counter()
    yield
    ms[name] = ms.get(name, 0.0) + (time.perf_counter() - start) * 1e3
