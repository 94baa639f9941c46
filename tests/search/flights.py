"""What flies a scenario, and flights of many scenarios, in order, by one process or several."""

from __future__ import annotations

import gc
import logging
import multiprocessing
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from typing import Any

from tests.search.flight import CHEAP, DETAILS, Outcome, Weakness, fly
from tests.search.scenario import Scenario

FlyAll = Callable[[Iterable[Scenario]], Iterator[Outcome]]


@dataclass(frozen=True, slots=True)
class Flier:
    """Flies scenarios in one detail, with a weakness or without, and says so in the files of its flights.

    Attributes
    ----------
    detail
        One of `DETAILS`.
    weakness
        Planted in the program; None is the program as it is.
    fly
        Makes the outcome.
    """

    detail: str = CHEAP
    weakness: Weakness | None = None
    fly: Callable[..., Outcome] = fly

    @property
    def head(self) -> dict[str, Any]:
        """The detail and its figures, for the head of a file."""
        return {self.detail: DETAILS[self.detail]}

    def __call__(self, scenario: Scenario) -> Outcome:
        return self.fly(scenario, self.detail, weakness=self.weakness)


@contextmanager
def flying(flier: Flier, jobs: int) -> Iterator[FlyAll]:
    """Yield what gives the outcomes of scenarios in order; with several jobs, `flier` must be picklable."""
    if jobs == 1:
        yield partial(map, flier)
        return
    with multiprocessing.get_context("forkserver").Pool(jobs, _quiet) as pool:
        yield partial(pool.imap, flier)


def _quiet() -> None:
    """Say nothing of the flights; what is loaded stays, so that collections need not look at it."""
    logging.disable(logging.CRITICAL)
    gc.collect()
    gc.freeze()
