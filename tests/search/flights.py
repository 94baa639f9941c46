"""Flights of many scenarios, in order, by one process or several."""

from __future__ import annotations

import gc
import logging
import multiprocessing
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from functools import partial

from tests.search.flight import Outcome
from tests.search.scenario import Scenario

Fly = Callable[[Scenario], Outcome]
FlyAll = Callable[[Iterable[Scenario]], Iterator[Outcome]]


@contextmanager
def flying(fly: Fly, jobs: int) -> Iterator[FlyAll]:
    """Yield what gives the outcomes of scenarios in order; with several jobs, `fly` must be picklable."""
    if jobs == 1:
        yield partial(map, fly)
        return
    with multiprocessing.get_context("forkserver").Pool(jobs, _quiet) as pool:
        yield partial(pool.imap, fly)


def _quiet() -> None:
    """Say nothing of the flights; what is loaded stays, so that collections need not look at it."""
    logging.disable(logging.CRITICAL)
    gc.collect()
    gc.freeze()
