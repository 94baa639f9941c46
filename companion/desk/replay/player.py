"""Playback of a recording in a thread, with variable speed, pause and seek."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator
from typing import Protocol

from companion.flight.fusion.pose_history import PoseHistory
from companion.flight.link.vehicle_state import VehicleState
from companion.flight.sensors.diagnosis.lidar_diagnosis import LidarDiagnosis
from slz import Pipeline, Report

Step = tuple[int, Callable[[bool], Report | None]]
LONGEST_WAIT_S = 0.1


class Playing(Protocol):
    """One run of a recording from its beginning."""

    report: Report | None

    @property
    def history(self) -> PoseHistory: ...

    @property
    def vehicle(self) -> VehicleState: ...

    @property
    def pipeline(self) -> Pipeline: ...

    @property
    def diagnosis(self) -> LidarDiagnosis | None: ...


class Player:
    """Runs the steps of a recording at their times.

    To seek backwards it starts again and runs up to the requested second as fast as possible, so that the
    maps are those of that second.

    Parameters
    ----------
    open_run
        Opens the recording: returns the run and its steps.
    on_step
        Called after every step with the run, the second of the flight, the step's stamp (ns) and its report
        or None.
    on_begin
        Called at every start of a run.

    Attributes
    ----------
    at_s, length_s
        Second of the flight; the largest one reached or known.
    speed
        Seconds of flight per second; 0 pauses.
    ended
        Whether the last step has run.
    """

    def __init__(
        self,
        open_run: Callable[[], tuple[Playing, Iterator[Step]]],
        on_step: Callable[[Playing, float, int, Report | None], None],
        on_begin: Callable[[], None],
        length_s: float = 0.0,
        speed: float = 1.0,
    ) -> None:
        self._open_run, self._on_step, self._on_begin = open_run, on_step, on_begin
        self._wake = threading.Condition()
        self._target_s: float | None = None
        self._closed = False
        self._anchor = (0.0, 0.0)  # second of the flight, and its monotonic time
        self.at_s, self.length_s, self.speed = 0.0, length_s, speed
        self.ended = False

    # ---- control, from any thread ---------------------------------------------------------------

    def set_speed(self, speed: float) -> None:
        """Set the speed; 0 pauses."""
        with self._wake:
            self.speed = speed
            self._anchor = self.at_s, time.monotonic()
            self._wake.notify()

    def go_to(self, at_s: float) -> None:
        """Seek to a second of the flight."""
        with self._wake:
            self._target_s = at_s
            self._wake.notify()

    def close(self) -> None:
        """Make `run` return."""
        with self._wake:
            self._closed = True
            self._wake.notify()

    # ---- the thread -----------------------------------------------------------------------------

    def run(self) -> None:
        """Play until closed; at the end wait for a seek backwards."""
        while not self._closed:
            self._on_begin()
            self.ended, self.at_s = False, 0.0
            self._anchor = 0.0, time.monotonic()
            self._play(*self._open_run())
            self._wait_to_go_back()

    def _play(self, playing: Playing, steps: Iterator[Step]) -> None:
        begun_ns: int | None = None
        for stamp_ns, take in steps:
            begun_ns = stamp_ns if begun_ns is None else begun_ns
            at_s = (stamp_ns - begun_ns) * 1e-9
            if not self._is_due(at_s):
                return
            report = take(True)
            self.at_s, self.length_s = at_s, max(self.length_s, at_s)
            self._on_step(playing, at_s, stamp_ns, report)
        self.ended = True

    def _is_due(self, at_s: float) -> bool:
        """Wait for a second of the flight; return False when the run must restart or end."""
        with self._wake:
            while not self._closed:
                now = time.monotonic()
                if self._target_s is not None:
                    if self._target_s < self.at_s:
                        return False
                    if at_s < self._target_s:
                        return True
                    self._target_s = None
                    self._anchor = at_s, now
                due = self._anchor[1] + (at_s - self._anchor[0]) / self.speed if self.speed > 0 else now + 1
                if due <= now:
                    return True
                self._wake.wait(min(due - now, LONGEST_WAIT_S))
        return False

    def _wait_to_go_back(self) -> None:
        with self._wake:
            while self.ended and not self._closed:
                if self._target_s is not None:
                    if self._target_s < self.at_s:
                        return
                    self._target_s = None
                self._wake.wait(LONGEST_WAIT_S)
