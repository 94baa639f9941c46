"""Workers of Dask find what one process finds; `-m bench`: also when they are killed."""

from __future__ import annotations

import os
import signal
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from companion.survey.tiled import plan
from companion.survey.tiled.engine import Distributed, engine
from tests.unit.companion.survey.tiled.ground import answer, files, points, surveyed

pytest.importorskip("distributed", reason="needs Dask: pip install 'slz[survey]'")

POINTS = points(40_000)


class Killing:
    """Kills one of the workers at the beginning of every step."""

    def __init__(self, workers: Distributed) -> None:
        self._workers = workers
        self.killed: list[int] = []

    def each(self, task: Callable[..., Any], items: Sequence[Any], *shared: Any) -> Iterator[tuple[Any, Any]]:
        for count, pair in enumerate(self._workers.each(task, items, *shared)):
            if count == 0 and task.__name__ in ("sort_piece", "draw_tile"):
                pids = self._workers.process_ids()
                self.killed.append(pids[-1])
                os.kill(pids[-1], signal.SIGKILL)
            yield pair


@pytest.mark.filterwarnings("default")
def test_a_dask_cluster_finds_what_one_process_finds(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    import distributed

    monkeypatch.setattr(plan, "PIECE", 5_000)
    paths = files(tmp_path, POINTS, np.arange(len(POINTS)), 2)
    alone = surveyed(paths, tmp_path / "alone", 100)
    here = {"processes": False, "n_workers": 2, "threads_per_worker": 1, "dashboard_address": None}
    with distributed.Client(**here) as client, engine(client.scheduler.address, None) as workers:
        assert answer(surveyed(paths, tmp_path / "together", 100, workers)) == answer(alone)


@pytest.mark.bench
@pytest.mark.filterwarnings("default")
def test_killed_workers_lose_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(plan, "PIECE", 5_000)
    paths = files(tmp_path, POINTS, np.arange(len(POINTS)), 2)
    alone = surveyed(paths, tmp_path / "alone", 100)
    with engine(None, 2) as workers:
        assert isinstance(workers, Distributed)
        killing = Killing(workers)
        together = surveyed(paths, tmp_path / "together", 100, killing)
    assert len(set(killing.killed)) == 2
    assert answer(together) == answer(alone)
