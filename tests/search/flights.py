"""Flights of many scenarios, in order, by one process or several."""

from __future__ import annotations

import gc
import logging
import multiprocessing
from collections.abc import Callable, Iterator, Sequence

from tests.search.flight import Outcome
from tests.search.scenario import Scenario

Fly = Callable[[Scenario], Outcome]


def outcomes(fly: Fly, scenarios: Sequence[Scenario], jobs: int) -> Iterator[Outcome]:
    """Yield the outcomes in the order of the scenarios; with several jobs, `fly` must be picklable."""
    if jobs == 1:
        yield from map(fly, scenarios)
        return
    with multiprocessing.get_context("forkserver").Pool(jobs, _quiet) as pool:
        yield from pool.imap(fly, scenarios)


def _quiet() -> None:
    """Say nothing of the flights; what is loaded stays, so that collections need not look at it."""
    logging.disable(logging.CRITICAL)
    gc.collect()
    gc.freeze()
