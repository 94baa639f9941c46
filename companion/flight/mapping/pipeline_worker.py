"""Worker thread of the mapping pipeline: scans in, reports out."""

from __future__ import annotations

import asyncio
import logging
import math
import os
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from functools import partial

import numpy as np
from numpy.typing import NDArray

from companion.flight.mapping.report_invariants import (
    OLDEST_NS,
    BrokenInvariantError,
    Invariants,
    LateReportError,
)
from companion.flight.mapping.window_event import WindowEvent, differences, runs
from companion.flight.mapping.window_pace import WindowPace
from companion.runtime.clock import now_ns
from companion.runtime.event import Event
from companion.runtime.ring_buffer import RingBuffer
from params import Parameters
from slz import Pipeline, Report, Scan, TerrainMaps, Window, Windower
from slz.prior import Source as PriorSource
from slz.surface.surface_kinds import UNKNOWN_SURFACE
from slz.warm_up import warm_up

log = logging.getLogger(__name__)

AGES = 9  # returns of a window whose ages are noted
LAST = 10  # windows whose computing is told


class PipelineWorker:
    """Collects scans into windows and runs the pipeline on them in one thread.

    Windows are longer on a slow computer, see `WindowPace`. While one is computed the next one grows,
    and waits when it is as long as is of use; a third replaces the waiting one, which is counted in
    `dropped_windows`. An exception in the pipeline, or a report that breaks an invariant, sets `invalid`
    until a window succeeds. Windows and reports too old to land by, because scans stopped in mid-window or
    the computer is slow, are dropped and counted, and the last report stays in use until it is too old.

    Parameters
    ----------
    prior
        Source of ground surveyed before the flight.
    oldest_ns
        Age from which a window or report is too old to land by, from the window's end.

    Attributes
    ----------
    failed, late
        Windows whose report was withdrawn; windows and reports that were too old.
    below
        Surface of the ground under the sensor after the last window.
    ages_ms
        Of each report (`AGES`,): ages of returns spread over its window, from their own stamps to the report.
    computing_ms
        Of each report, by the wall clock.
    on_report
        Event of a report.
    on_invalid
        Event of the first failed report after a success, with the reason.
    on_window
        Event of a window that the pipeline starts on.
    display_hooks
        Called with the pipeline, in its thread, after a report while no window waits; by display.
    """

    def __init__(
        self,
        parameters: Parameters,
        prior: PriorSource | None = None,
        *,
        oldest_ns: int = OLDEST_NS,
    ) -> None:
        self._parameters = parameters
        self._numbers: list[int] = []
        self.pace = WindowPace(parameters)
        self._windower = Windower(self.pace.window_s, parameters.window_s)
        # A second thread if there is a second core.
        self._pipeline = Pipeline(parameters, threads=min(2, os.cpu_count() or 1), prior=prior)
        self._oldest_ns = oldest_ns
        self._invariants = Invariants(oldest_ns)
        self._thread = ThreadPoolExecutor(1, thread_name_prefix="slz-pipeline")
        self._waiting: tuple[Window, list[int]] | None = None
        self._windows = 0
        self.on_window: Event[[WindowEvent, Window]] = Event()
        self.display_hooks: dict[str, Callable[[Pipeline], None]] = {}
        self._wake = asyncio.Event()
        self._select: list[NDArray[np.float64] | None] = []
        self._forget = False
        self.on_report: Event[[Report]] = Event()
        self.on_invalid: Event[[str]] = Event()
        self.invalid = False
        self.below = UNKNOWN_SURFACE
        self.failed = 0
        self.late = 0
        self._busy_since_s: float | None = None
        self.dropped_windows = 0
        self.reports = 0
        self.ages_ms = RingBuffer(10_000, (AGES,))
        self.computing_ms = RingBuffer(10_000)

    async def warm_up(self) -> None:
        """Load or compile all kernels; call it before the heartbeat reports ready."""
        await asyncio.get_running_loop().run_in_executor(self._thread, warm_up, self._parameters)

    def add_scan(self, scan: Scan, number: int = 0) -> None:
        """Add a scan with its sequence number; never blocks."""
        is_awaited = self._waiting is None and not self.busy
        windows = list(self._windower.add(scan, is_awaited=is_awaited))
        if windows and (self._windower.is_open or len(windows) == 2):
            self._put(windows.pop(0))  # ended before this scan
        self._numbers.append(number)
        for window in windows:
            self._put(window)

    def flush(self) -> None:
        """Close the current window now, because nothing will be mapped for a while."""
        window = self._windower.flush()
        if window is not None:
            self._put(window)

    def _put(self, window: Window) -> None:
        numbers, self._numbers = self._numbers, []
        if self._waiting is not None:
            self.dropped_windows += 1
        self._waiting = (window, numbers)
        self._wake.set()

    def reset(self) -> None:
        """Drop map and selection: the position estimate moved, and both are misplaced."""
        self._forget = True
        self.below = UNKNOWN_SURFACE
        self._select = []
        self._waiting = None
        self._numbers = []
        self._windower = Windower(self._windower.window_s, self._windower.longest_s)

    @property
    def window_s(self) -> float:
        """Span of the current window."""
        return self._windower.window_s

    @property
    def age_ms(self) -> float:
        """Median age of the last window's returns when it was reported, NaN before any."""
        return float(self.ages_ms.last[AGES // 2]) if self.reports else math.nan

    @property
    def computing_share(self) -> float:
        """Share of the time that the pipeline computes, in the last windows."""
        last = self.computing_ms.array(LAST)
        return float(last.mean()) * 1e-3 / self.window_s if len(last) else 0.0

    @property
    def busy(self) -> bool:
        """True if a window is being computed."""
        return self._busy_since_s is not None

    def hangs(self, limit_s: float) -> bool:
        """Return whether a window has been computed for longer than a limit."""
        since_s = self._busy_since_s
        return since_s is not None and asyncio.get_running_loop().time() - since_s > limit_s

    def select(self, enu_m: NDArray[np.float64] | None) -> None:
        """Select a landing point from the next window on, None for none."""
        self._select = [enu_m]

    def use(self, parameters: Parameters) -> None:
        """Use other parameters from the next window on; only those that may change in flight differ."""
        self._parameters = parameters

    async def run(self) -> None:
        """Process windows until cancelled."""
        loop = asyncio.get_running_loop()
        while True:
            await self._wake.wait()
            self._wake.clear()
            if self._waiting is None:
                continue
            (window, numbers), self._waiting = self._waiting, None
            if now_ns() - window.end_ns > self._oldest_ns:
                self.late += 1
                continue
            selects, self._select = self._select, []
            anew, self._forget = self._forget, False
            parameters, before = self._parameters, self._pipeline.parameters
            changed = () if parameters is before else differences(before, parameters)
            points = tuple(None if p is None else (float(p[0]), float(p[1]), float(p[2])) for p in selects)
            event = WindowEvent(self._windows, runs(numbers), points, anew, changed)
            self.on_window.emit(event, window)
            self._windows += 1
            task = partial(self._process, window, selects, anew, parameters, loop.time)
            self._busy_since_s = began_s = loop.time()
            try:
                report = await loop.run_in_executor(self._thread, task)
            except LateReportError as error:
                self.late += 1
                log.warning("a report came too late: %s", error)
                continue
            except Exception as error:
                self._invalidate(error)
                continue
            finally:
                self._busy_since_s = None
            if self._forget:  # the estimate moved meanwhile: the report's places are wrong
                continue
            self.invalid = False
            self.reports += 1
            self._follow(report, window, loop.time() - began_s)
            self.on_report.emit(report)
            for display in tuple(self.display_hooks):
                if self._waiting is None:
                    await self._show(loop, display)
            if self._waiting is None:
                await self._prepare(loop)
            if self._waiting is None and self._windower.is_over(self.window_s):
                self.flush()

    def _follow(self, report: Report, window: Window, took_s: float) -> None:
        """Note how old the returns of a reported window are, and pace the next ones.

        Computing that takes no simulated time makes them older by what it takes by the wall clock.
        """
        alone = report.n_alone / max(1, report.n_points)
        self.pace.follow(took_s, report.choice.window_s, alone)
        self._windower.window_s, self._windower.longest_s = self.pace.window_s, report.choice.window_s
        rows = np.linspace(0, len(window) - 1, AGES).astype(np.intp)
        untold_ms = max(0.0, float(self.computing_ms.last) - took_s * 1e3)
        self.ages_ms.append((now_ns() - window.stamp_ns[rows]).astype(np.float64) * 1e-6 + untold_ms)

    async def _show(self, loop: asyncio.AbstractEventLoop, display: str) -> None:
        """Call a display's hook; one that fails is removed, so that the landing goes on."""
        try:
            await loop.run_in_executor(self._thread, self.display_hooks[display], self._pipeline)
        except Exception:
            self.display_hooks.pop(display, None)
            log.exception("the map on the %s failed; it is drawn no more", display)

    async def _prepare(self, loop: asyncio.AbstractEventLoop) -> None:
        """Let the pipeline prepare memory; a failure costs only time."""
        try:
            await loop.run_in_executor(self._thread, self._pipeline.prepare)
        except Exception:
            log.exception("no memory could be made ready for the next window")

    def _invalidate(self, error: Exception) -> None:
        """Mark the last report as invalid: this window has none."""
        was_invalid, self.invalid = self.invalid, True
        self.failed += 1
        known = isinstance(error, BrokenInvariantError)
        trace = None if known else error
        log.error("a window failed, the last report is withdrawn: %s", error, exc_info=trace)
        if not was_invalid:
            self.on_invalid.emit(str(error) if known else type(error).__name__)

    def _process(
        self,
        window: Window,
        selects: list[NDArray[np.float64] | None],
        anew: bool,
        parameters: Parameters,
        time_s: Callable[[], float],
    ) -> Report:
        if parameters is not self._pipeline.parameters:
            self._pipeline.use(parameters)
        if anew:
            self._pipeline.begin_new_map()
        for point in selects:
            self._pipeline.select(point)
        began_s = time.perf_counter()
        report = self._pipeline.process(window)
        self.computing_ms.append((time.perf_counter() - began_s) * 1e3)
        self._invariants.check(report, self._pipeline, round(time_s() * 1e9))
        self.below = self._pipeline.surface_at(window.sensor_enu_m)
        return report

    def close(self) -> TerrainMaps | None:
        """End the thread after the current window; return the last maps."""
        self._thread.shutdown(wait=True, cancel_futures=True)
        return self._pipeline.maps()
