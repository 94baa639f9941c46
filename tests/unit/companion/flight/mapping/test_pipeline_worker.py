"""Pipeline thread: windows in, reports out, reports withdrawn after failures."""

import asyncio
import math
import threading
import time
from collections.abc import Callable

import numpy as np
import pytest

import params
from companion.flight.mapping.pipeline_worker import PipelineWorker
from companion.flight.mapping.report_invariants import Invariants, Verdicts
from companion.flight.mapping.window_event import WindowEvent
from companion.runtime.clock import now_ns
from slz import LocalFrame, Pipeline, Report, Scan, Window

BEGIN_NS = time.monotonic_ns() - 10_000_000_000  # the stamps are of the loop's clock
FRAME = LocalFrame(47.0, 8.0, 400.0)
SMALL = params.load("quadcopter", ["zone_m=40", "window_s=1", "adaptive=off"])


def scan(second: float, begin_ns: int = BEGIN_NS) -> Scan:
    rng = np.random.default_rng(round(second * 10))
    points = np.column_stack([rng.uniform(-8, 8, (3000, 2)), rng.normal(0, 0.01, 3000)])
    stamps = (begin_ns + second * 1e9 + np.linspace(0, 0.4e9, 3000)).astype(np.int64)
    return Scan(points, stamps, np.array([0.0, 0.0, 20.0]), FRAME)


def worker_to(reports: list[Report]) -> PipelineWorker:
    made = PipelineWorker(SMALL, oldest_ns=3600_000_000_000)  # however slow the test is
    made.on_report.subscribe(reports.append)
    return made


async def drive(worker: PipelineWorker, until: Callable[[], bool]) -> None:
    task = asyncio.create_task(worker.run())
    async with asyncio.timeout(60):
        while not until():
            await asyncio.sleep(0)
    task.cancel()
    await asyncio.gather(task, return_exceptions=True)
    worker.close()


async def test_a_window_makes_a_report_with_the_age_of_its_returns() -> None:
    reports: list[Report] = []
    worker = worker_to(reports)
    assert math.isnan(worker.age_ms)
    for second in (0, 0.5, 1.0):
        worker.add_scan(scan(second))
    await drive(worker, lambda: bool(reports))
    assert len(reports[0].zones) == 1
    assert worker.reports == 1
    reported_ns = now_ns()
    oldest_ms, newest_ms = worker.ages_ms.last[[0, -1]]
    assert oldest_ms - newest_ms == pytest.approx(900.0)
    assert newest_ms < worker.age_ms < oldest_ms < (reported_ns - BEGIN_NS) * 1e-6 < oldest_ms + 10_000


async def test_memory_is_made_ready_after_a_report_and_a_failure_of_that_costs_none(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    reports: list[Report] = []
    worker = worker_to(reports)
    known: list[int] = []

    def fail(_: Pipeline) -> None:
        known.append(len(reports))
        worker.add_scan(scan(5.0))
        raise MemoryError("broken on purpose")

    monkeypatch.setattr(Pipeline, "prepare", fail)
    for second in (0, 1.0):
        worker.add_scan(scan(second))
    await drive(worker, lambda: len(reports) == 2)
    assert known[0] == 1
    assert not worker.invalid


async def test_the_newest_window_wins_and_the_lost_one_is_counted() -> None:
    reports: list[Report] = []
    worker = worker_to(reports)
    for second in range(5):
        worker.add_scan(scan(second))
    await drive(worker, lambda: bool(reports))
    assert worker.dropped_windows == 3
    assert reports[0].stamp_ns > BEGIN_NS + 3e9


async def test_a_parameter_changed_in_flight_holds_from_the_next_window_on() -> None:
    stricter = params.build(SMALL.model_dump() | {"min_certainty": 0.95})
    changed: list[object] = []

    def next_window(_: Report) -> None:
        worker.add_scan(scan(len(changed) + 1.0))

    def change(event: WindowEvent, _: Window) -> None:  # the pipeline's thread begins with its window now
        changed.append(event.changed)
        worker.use(stricter)

    worker = PipelineWorker(SMALL, oldest_ns=3600_000_000_000)
    worker.on_report.subscribe(next_window)
    worker.on_window.subscribe(change)
    for second in (0.0, 1.0):
        worker.add_scan(scan(second))
    await drive(worker, lambda: len(changed) == 2)
    assert changed == [(), (("min_certainty", 0.95),)]


async def test_a_failure_withdraws_the_answer_until_a_window_succeeds(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    reports: list[Report] = []
    worker = worker_to(reports)
    process = Pipeline.process

    def fail(self: Pipeline, window: Window) -> Report:
        monkeypatch.setattr(Pipeline, "process", process)
        raise ArithmeticError("broken on purpose")

    monkeypatch.setattr(Pipeline, "process", fail)
    worker.add_scan(scan(0))
    worker.add_scan(scan(1))
    task = asyncio.create_task(worker.run())
    async with asyncio.timeout(60):
        while not worker.invalid:
            await asyncio.sleep(0)
        worker.add_scan(scan(2))
        while worker.invalid:
            await asyncio.sleep(0)
    task.cancel()
    await asyncio.gather(task, return_exceptions=True)
    worker.close()
    assert len(reports) == 1


async def test_a_report_that_breaks_an_invariant_is_withdrawn_and_told_once(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    reports: list[Report] = []
    told: list[str] = []
    worker = worker_to(reports)
    worker.on_invalid.subscribe(told.append)
    monkeypatch.setattr(Pipeline, "state", lambda _self, _which, box: np.full(box.shape, 255, np.uint8))
    for second in range(2):
        worker.add_scan(scan(second))
    task = asyncio.create_task(worker.run())
    async with asyncio.timeout(60):
        for failed in (1, 2):
            while worker.failed < failed:
                await asyncio.sleep(0)
            worker.add_scan(scan(failed + 1))
        monkeypatch.undo()
        while not reports:
            await asyncio.sleep(0)
            worker.add_scan(scan(4 + len(told)))
    task.cancel()
    await asyncio.gather(task, return_exceptions=True)
    worker.close()
    assert len(told) == 1
    assert "are not safe in the near map" in told[0]
    assert not worker.invalid


async def test_what_was_gathered_is_not_kept_while_nothing_is_mapped() -> None:
    reports: list[Report] = []
    worker = worker_to(reports)
    worker.add_scan(scan(0))
    worker.flush()
    worker.flush()
    await drive(worker, lambda: bool(reports))
    assert reports[0].n_points == 3000
    assert worker.dropped_windows == 0


async def test_a_point_selected_is_judged_with_the_next_window() -> None:
    reports: list[Report] = []
    worker = worker_to(reports)
    worker.add_scan(scan(0))
    worker.add_scan(scan(1))
    task = asyncio.create_task(worker.run())
    async with asyncio.timeout(60):
        while not reports:
            await asyncio.sleep(0)
        worker.select(np.array([1.0, 1.0, 0.0]))
        worker.add_scan(scan(2))
        while len(reports) < 2:
            await asyncio.sleep(0)
    task.cancel()
    await asyncio.gather(task, return_exceptions=True)
    worker.close()
    assert reports[0].selected is None
    assert reports[1].selected is not None


async def test_a_report_of_the_map_before_a_jump_is_dropped(monkeypatch: pytest.MonkeyPatch) -> None:
    reports: list[Report] = []
    worker = worker_to(reports)
    process = Pipeline.process

    def jump_meanwhile(self: Pipeline, window: Window) -> Report:
        monkeypatch.setattr(Pipeline, "process", process)
        report = process(self, window)
        worker.reset()
        for second in (5, 6):
            worker.add_scan(scan(second))
        return report

    monkeypatch.setattr(Pipeline, "process", jump_meanwhile)
    for second in (0, 1):
        worker.add_scan(scan(second))
    await drive(worker, lambda: bool(reports))
    assert reports[0].stamp_ns > 4e9


async def test_zone_numbers_go_on_after_a_jump_so_that_an_old_one_names_no_other_ground() -> None:
    reports: list[Report] = []

    def jump_once(report: Report) -> None:
        reports.append(report)
        if len(reports) == 1:
            worker.reset()
            for second in (5, 6):
                worker.add_scan(scan(second))

    worker = PipelineWorker(SMALL, oldest_ns=3600_000_000_000)
    worker.on_report.subscribe(jump_once)
    for second in (0, 1):
        worker.add_scan(scan(second))
    await drive(worker, lambda: len(reports) == 2)
    before, after = ({zone.id for zone in (*report.zones, *report.far.zones)} for report in reports)
    assert before
    assert after
    assert max(before) < min(after)


async def test_a_window_that_waits_when_the_estimate_jumps_is_never_computed() -> None:
    reports: list[Report] = []
    worker = worker_to(reports)
    worker.add_scan(scan(0))
    worker.add_scan(scan(1))
    worker.reset()
    task = asyncio.create_task(worker.run())
    for _ in range(20):
        await asyncio.sleep(0)
        assert not worker.busy
    task.cancel()
    await asyncio.gather(task, return_exceptions=True)
    worker.close()
    assert (reports, worker.reports) == ([], 0)


async def test_a_display_that_fails_is_dropped_and_costs_no_report(caplog: pytest.LogCaptureFixture) -> None:
    reports: list[Report] = []
    worker = worker_to(reports)

    def fail(_pipeline: Pipeline) -> None:
        raise RuntimeError("planted")

    worker.display_hooks["page"] = fail
    for second in (0, 1):
        worker.add_scan(scan(second))
    await drive(worker, lambda: not worker.display_hooks)
    assert len(reports) == 1
    assert not worker.invalid
    assert "planted" in caplog.text


async def test_it_hangs_once_a_window_takes_longer_than_the_limit(monkeypatch: pytest.MonkeyPatch) -> None:
    def process(_self: Pipeline, _window: Window) -> Report:
        begun.set()
        go_on.wait(60)
        raise ArithmeticError("broken on purpose")

    begun, go_on = threading.Event(), threading.Event()
    monkeypatch.setattr(Pipeline, "process", process)
    worker = worker_to([])
    worker.add_scan(scan(0))
    worker.add_scan(scan(1))
    assert not worker.hangs(0.0)
    task = asyncio.create_task(worker.run())
    async with asyncio.timeout(60):
        while not begun.is_set():
            await asyncio.sleep(0)
        assert worker.busy
        assert worker.hangs(0.0)
        assert not worker.hangs(3600.0)
        go_on.set()
        while worker.busy:
            await asyncio.sleep(0)
    assert not worker.hangs(0.0)
    task.cancel()
    await asyncio.gather(task, return_exceptions=True)
    worker.close()


async def test_a_point_selected_before_the_map_was_forgotten_is_forgotten_with_it() -> None:
    reports: list[Report] = []
    worker = worker_to(reports)
    worker.select(np.array([1.0, 1.0, 0.0]))
    worker.reset()
    for second in (0, 0.5, 1.0):
        worker.add_scan(scan(second))
    await drive(worker, lambda: bool(reports))
    assert reports[0].selected is None


async def test_a_window_left_half_gathered_by_an_outage_is_dropped_and_counted_not_called_invalid() -> None:
    reports: list[Report] = []
    told: list[str] = []
    worker = PipelineWorker(SMALL)
    worker.on_report.subscribe(reports.append)
    worker.on_invalid.subscribe(told.append)
    begin_ns = now_ns() - 30_000_000_000
    worker.add_scan(scan(0.0, begin_ns))
    worker.add_scan(scan(29.0, begin_ns))  # the link is back
    await drive(worker, lambda: worker.late > 0)
    assert (worker.late, worker.failed, worker.invalid, told, reports) == (1, 0, False, [], [])


async def test_a_report_that_comes_too_late_leaves_the_last_one_and_calls_no_map_invalid(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    reports: list[Report] = []
    told: list[str] = []
    worker = worker_to(reports)
    worker.on_invalid.subscribe(told.append)
    check = Invariants.check

    def late(self: Invariants, report: Report, verdicts: Verdicts, now_ns: int) -> None:
        monkeypatch.setattr(Invariants, "check", check)
        check(self, report, verdicts, now_ns + 4_000_000_000_000)

    monkeypatch.setattr(Invariants, "check", late)
    worker.add_scan(scan(0))
    worker.add_scan(scan(1))
    task = asyncio.create_task(worker.run())
    async with asyncio.timeout(60):
        while not worker.late:
            await asyncio.sleep(0)
        worker.add_scan(scan(2))
        while not reports:
            await asyncio.sleep(0)
    task.cancel()
    await asyncio.gather(task, return_exceptions=True)
    worker.close()
    assert (worker.failed, worker.invalid, told) == (0, False, [])
