"""`slz replay`: a recorded flight, run again."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

import numpy as np

from companion import folder
from companion.errors import UsageError
from companion.replay.reading import Recording
from companion.replay.replay import Replay
from companion.summary import choice_summary, zone_summary
from slz.warm_up import warm_up


def run(
    path: Path,
    settings: Iterable[str],
    out: Path | None,
    speed: float,
    span_s: tuple[float, float],
    step: Callable[[float, str], None] = lambda _share, _text: None,
) -> dict[str, Any]:
    """Replay a recording and return the summary.

    Parameters
    ----------
    settings
        `name=value` of parameters to replace.
    out
        Folder for the maps at the end.
    speed
        Seconds of flight in a second; 0 as fast as possible.
    span_s
        Windows from and until so many seconds after the recording's beginning; those before are not mapped.
    step
        Told of every window: seconds since the beginning, and what was found.

    Raises
    ------
    UsageError
        The recording or a setting is of no use, or the folder cannot be written.
    """
    recording = Recording(path)
    settings = tuple(settings)
    parameters = recording.header.parameters(settings)
    replay = Replay(recording.header, parameters)
    if out is not None:
        folder.prepare(out)
    warm_up(parameters)
    begun_ns: int | None = None
    started_s = time.monotonic()
    for message in recording.messages():
        begun_ns = message.at_ns if begun_ns is None else begun_ns
        at_s = (message.at_ns - begun_ns) * 1e-9
        if at_s > span_s[1]:
            break
        if speed > 0:
            time.sleep(max(0.0, at_s / speed - (time.monotonic() - started_s)))
        report = replay.take(message, mapping=at_s >= span_s[0])
        if report is not None:
            step(at_s, f"{len(report.zones)} zones")
    if begun_ns is None:
        raise UsageError(f"{path} holds no message to replay")
    files = {} if out is None else _draw(replay, out)
    return _summary(path, recording, replay, settings, files)


def _summary(
    path: Path, recording: Recording, replay: Replay, given: tuple[str, ...], files: dict[str, str]
) -> dict[str, Any]:
    o, report = replay.outcome, replay.report
    return {
        "file": str(path),
        "windows": o.windows,
        "identical": o.same,
        "different": o.other,
        "first_different_ns": o.first_other_ns,
        "without_scans": o.without_scans,
        "failed": o.failed,
        "lost_messages": o.lost,
        "unreadable_messages": o.bad,
        "cut": recording.cut,
        "set": list(given),
        "zones": [] if report is None else [zone_summary(zone, report.frame) for zone in report.zones],
        "choice": None if report is None else choice_summary(report),
        "files": files,
    }


def _draw(replay: Replay, out: Path) -> dict[str, str]:
    from companion.figures import save_flight

    maps, report = replay.maps(), replay.report
    if maps is None or report is None:
        return {}
    chosen = None if report.selected is None else report.selected.enu_m
    flown = np.array(replay.outcome.path_enu_m).reshape(-1, 3)
    files = save_flight(out, maps, report.zones, flown, chosen, None, replay.parameters)
    return {file.stem: str(file) for file in files}
