"""Equality of a Dask survey with that of one process; with `-m bench` also when workers are killed."""

from __future__ import annotations

import logging
import os
import signal
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from companion.desk import survey
from companion.desk.survey.tiled import plan
from companion.desk.survey.tiled.task_engine import Distributed, InProcess, engine
from companion.runtime.errors import CompanionError
from tests.unit.companion.desk.survey.tiled.ground import answer, files, parameters, points, surveyed

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


class Elsewhere:
    """Carries tasks out in another folder, as workers do that were started there."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder

    def each(self, task: Callable[..., Any], items: Sequence[Any], *shared: Any) -> Iterator[tuple[Any, Any]]:
        for item in items:
            with pytest.MonkeyPatch.context() as patch:
                patch.chdir(self._folder)
                pair = next(iter(InProcess().each(task, [item], *shared)))
            yield pair


def test_relative_names_mean_the_same_to_workers_of_another_folder(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("companion.desk.figures.save_maps", lambda *_: [])
    monkeypatch.chdir(tmp_path)
    files(tmp_path, POINTS, np.arange(len(POINTS)), 1)
    (tmp_path / "there").mkdir()
    elsewhere = survey.MapOptions(engine=Elsewhere(tmp_path / "there"))
    told = survey.run([Path("1.laz")], Path("out"), parameters(), lambda *_: None, elsewhere)
    assert len(told["zones"]) >= 2
    assert not told["skipped"]
    assert (tmp_path / "out" / "survey.json").is_file()
    assert not list((tmp_path / "there").iterdir())


def test_workers_that_cannot_be_started_are_one_line(monkeypatch: pytest.MonkeyPatch) -> None:
    def failing(**_: Any) -> None:
        raise RuntimeError("Nanny failed to start.")

    monkeypatch.setattr("distributed.LocalCluster", failing)
    with pytest.raises(CompanionError, match="could not be started: Nanny failed"), engine(None, 2):
        pass
    assert not logging.getLogger("distributed.scheduler").isEnabledFor(logging.INFO)


@pytest.mark.filterwarnings("default")
def test_a_scheduler_without_workers_is_told_of(caplog: pytest.LogCaptureFixture) -> None:
    import distributed

    here = {"processes": False, "n_workers": 0, "dashboard_address": None}
    with distributed.Client(**here) as client, engine(client.scheduler.address, None):
        assert "has no workers yet" in caplog.text


@pytest.mark.filterwarnings("default")
def test_a_scheduler_that_goes_away_is_one_line() -> None:
    import distributed

    cluster = distributed.LocalCluster(processes=False, n_workers=0, dashboard_address=None)
    with engine(cluster.scheduler_address, None) as workers:
        results = workers.each(abs, [1, 2])
        cluster.close()
        with pytest.raises(CompanionError, match="the scheduler is gone"):
            next(results)
