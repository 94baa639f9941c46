"""Task executors of a survey: this process, or Dask workers."""

from __future__ import annotations

import logging
import os
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from typing import Any, Protocol, TypeVar

from companion.runtime import extras
from companion.runtime.errors import CompanionError, UsageError
from companion.runtime.process_tuning import ENVIRONMENT

log = logging.getLogger(__name__)

T = TypeVar("T")
R = TypeVar("R")
AHEAD = 3  # tasks submitted ahead per worker
MOST_DEATHS = 10  # of workers at one task, before the task is blamed
WORKER_MEMORY = "1GiB"
CONNECT_S = 10.0

SOON_S = 5.0  # no remaining time is reported before this

Report = Callable[[str, float], None]


class Engine(Protocol):
    """Executor of repeatable tasks: each task's output is a file that is complete or absent."""

    def each(self, task: Callable[..., R], items: Sequence[T], *shared: Any) -> Iterator[tuple[T, R]]:
        """Call the task with every item and the shared arguments; return items and results as they complete.

        Workers start at once and run beside the caller; the in-process executor runs on iteration.
        """


class InProcess:
    """Sequential executor in this process."""

    def each(self, task: Callable[..., R], items: Sequence[T], *shared: Any) -> Iterator[tuple[T, R]]:
        for item in items:
            yield item, task(item, *shared)


class Distributed:
    """Executor on the workers of a Dask scheduler. Another worker repeats the task of a worker that died."""

    def __init__(self, client: Any) -> None:
        self._client = client

    def each(self, task: Callable[..., R], items: Sequence[T], *shared: Any) -> Iterator[tuple[T, R]]:
        from distributed import as_completed

        waiting = iter(items)
        futures: dict[Any, T] = {}

        def hand_out(most: int) -> list[Any]:
            new = []
            for _, item in zip(range(most), waiting, strict=False):
                future = self._client.submit(task, item, *shared, pure=False)
                futures[future] = item
                new.append(future)
            return new

        def results(first: list[Any]) -> Iterator[tuple[T, R]]:
            flow = as_completed(first)
            for future in flow:
                item = futures.pop(future)
                try:
                    result = future.result()
                except Exception as error:
                    raise _translated(error) from None
                for new in hand_out(1):
                    flow.add(new)
                yield item, result

        return results(hand_out(AHEAD * max(2, self._workers)))

    @property
    def _workers(self) -> int:
        return len(self._client.scheduler_info(n_workers=-1)["workers"])

    def process_ids(self) -> list[int]:
        """Return the process IDs of the workers."""
        return sorted(self._client.run(os.getpid).values())


class Progress:
    """Reporter of the current step, the completed share and the remaining time.

    Every step has a share of the whole; work done by an earlier run does not count for the remaining time.
    """

    def __init__(self, report: Report, clock: Callable[[], float] = time.monotonic) -> None:
        self._report = report
        self._clock = clock
        self._began = clock()
        self._from = self._to = self._resumed = 0.0
        self._what = ""
        self._total = 1

    def begin_stage(self, what: str, share: float, total: int, done: int = 0) -> None:
        """Begin a step of `total` tasks; an earlier run completed `done` of them."""
        self._from, self._to = self._to, min(1.0, self._to + share)
        self._what, self._total = what, max(1, total)
        self._resumed += (self._to - self._from) * done / self._total
        self.report(0)

    def report(self, count: int) -> None:
        """Report that `count` tasks of the step are done."""
        share = self._from + (self._to - self._from) * min(1.0, count / self._total)
        passed = self._clock() - self._began
        own = share - self._resumed
        left = ""
        if passed > SOON_S and own > 0.02 and share < 1:
            left = f", {_words(passed * (1 - share) / own)} left"
        self._report(f"{self._what}{left}", share)


def _translated(error: Exception) -> Exception:
    from distributed import CancelledError, KilledWorker

    if isinstance(error, CancelledError):
        return CompanionError("the scheduler is gone: start it and its workers, and run again")
    if isinstance(error, KilledWorker):
        return CompanionError(
            "workers died again and again at one task: give them more memory; run again to go on"
        )
    return error


@contextmanager
def engine(scheduler: str | None, workers: int | None) -> Iterator[Engine]:
    """Yield the executor: a scheduler's workers, `workers` local processes, or this process.

    Raises
    ------
    UsageError
        Dask is not installed, no scheduler answers, or both were requested.
    CompanionError
        A worker could not be started.
    """
    if scheduler is None and workers is None:
        yield InProcess()
        return
    if scheduler is not None and workers is not None:
        raise UsageError("--scheduler and --workers exclude each other: the scheduler's workers are used")
    if workers is not None and workers < 1:
        raise UsageError(f"--workers {workers}: one at least")
    try:
        import dask
        import distributed
    except ImportError:
        raise UsageError(extras.explain("--workers or --scheduler", "dask", "survey")) from None
    logging.getLogger("distributed").setLevel(logging.WARNING)  # the import sets a level of its own
    settings = {
        "distributed.scheduler.allowed-failures": MOST_DEATHS,
        "distributed.worker.multiprocessing-method": "spawn",
        "distributed.comm.timeouts.connect": "10s",
        # By default Dask makes workers return the memory of every short-lived array to the system.
        **{f"distributed.nanny.pre-spawn-environ.{name}": value for name, value in ENVIRONMENT.items()},
    }
    with dask.config.set(settings):
        if scheduler is not None:
            try:
                client = distributed.Client(scheduler, timeout=CONNECT_S)
            except (OSError, ValueError) as error:
                raise UsageError(f"--scheduler {scheduler}: no scheduler answers: {error}") from None
            with client:
                if not client.scheduler_info(n_workers=-1)["workers"]:
                    log.warning("%s has no workers yet: the survey begins when there is one", scheduler)
                yield Distributed(client)
            return
        with ExitStack() as stack:
            try:
                cluster = stack.enter_context(
                    distributed.LocalCluster(
                        n_workers=workers,
                        threads_per_worker=1,
                        memory_limit=WORKER_MEMORY,
                        dashboard_address="127.0.0.1:0",  # None would still take port 8787
                        scheduler_kwargs={"dashboard": False},
                        host="127.0.0.1",
                        silence_logs="CRITICAL",
                    )
                )
                client = stack.enter_context(distributed.Client(cluster))
            except (OSError, RuntimeError) as error:
                raise CompanionError(f"--workers {workers}: they could not be started: {error}") from None
            yield Distributed(client)


def _words(seconds: float) -> str:
    """Return a duration with its unit."""
    if seconds < 90:
        return f"{seconds:.0f} s"
    if seconds < 5400:
        return f"{seconds / 60:.0f} min"
    return f"{seconds / 3600:.1f} h" if seconds < 172_800 else f"{seconds / 86400:.1f} days"
