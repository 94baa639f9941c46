"""Replay run of `slz replay`: a flight recorded by slz or by another program."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Iterator
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from companion.desk.replay.loss_report import lost_for_time, not_mapped, why_no_zone, why_nothing
from companion.desk.replay.own_replay import Replay, ReplayOutcome
from companion.desk.replay.recording_reader import RecordingReader
from companion.desk.replay.recording_type import RecordingOptions, open_recording, recording_type_of
from companion.flight.outputs.report_summary import choice_summary, zone_summary
from companion.flight.sensors.diagnosis.lidar_diagnosis import LidarDiagnosis
from companion.runtime import output_folder
from companion.runtime.errors import UsageError
from params import Parameters
from slz import Report, TerrainMaps
from slz.warm_up import warm_up

Step = tuple[int, Callable[[bool], Report | None]]  # time (ns), and the call; its argument: whether to map


def run(
    path: Path,
    settings: Iterable[str],
    out: Path | None,
    speed: float,
    span_s: tuple[float, float],
    step: Callable[[float, str], None] = lambda _share, _text: None,
    options: RecordingOptions = RecordingOptions(),  # noqa: B008 - it is frozen
) -> dict[str, Any]:
    """Replay a recording and return the summary.

    Parameters
    ----------
    settings
        `name=value` of parameters to replace.
    out
        Folder for the maps at the end.
    speed
        Seconds of flight per second; 0 as fast as possible.
    span_s
        First and last second to map, from the beginning of the recording.
    step
        Called for every window: seconds since the beginning, and a line on its result.
    options
        Options for a recording of another program.

    Raises
    ------
    UsageError
        The recording or a setting cannot be used, or the folder cannot be written.
    """
    settings = tuple(settings)
    if recording_type_of(path) != "own":
        return _run_others(path, settings, out, speed, span_s, step, options)
    if not options.is_empty:
        raise UsageError(
            f"{path}: a recording of slz holds all it needs: leave out --points, --system and the like"
        )
    recording = RecordingReader(path)
    parameters = recording.header.parameters(settings)
    replay = Replay(recording.header, parameters)
    if out is not None:
        output_folder.prepare(out)
    warm_up(parameters)
    steps = ((message.at_ns, partial(replay.process_message, message)) for message in recording.messages())
    if not _play(steps, speed, span_s, step):
        raise UsageError(f"{path} holds no message to replay")
    files = {} if out is None else _draw(out, replay.maps(), replay.report, replay.outcome, parameters)
    summary = _summary(path, recording.cut, replay.outcome, replay.report, settings, files)
    why = "" if summary["zones"] else why_no_zone(replay.outcome, replay.maps(), parameters)
    return summary | {"why_no_zones": why} | _diagnosed(replay.diagnosis)


def _run_others(
    path: Path,
    settings: tuple[str, ...],
    out: Path | None,
    speed: float,
    span_s: tuple[float, float],
    step: Callable[[float, str], None],
    options: RecordingOptions,
) -> dict[str, Any]:
    feed, rerun = open_recording(path, settings, options)
    if out is not None:
        output_folder.prepare(out)
    steps = ((at_ns, partial(rerun.hand_over, act)) for at_ns, act in feed.steps(rerun))
    _play(steps, speed, span_s, step)
    rerun.finish()
    if not (rerun.assembler.scans or rerun.outcome.windows):
        raise UsageError(f"{path}: {why_nothing(feed, rerun)}")
    outcome = rerun.outcome
    outcome.bad = feed.bad
    files = {} if out is None else _draw(out, rerun.maps(), rerun.report, outcome, rerun.parameters)
    summary = _summary(path, feed.cut, outcome, rerun.report, settings, files)
    source: dict[str, Any] = feed.summary()
    returns: dict[str, Any] = {"read": rerun.returns} | rerun.assembler.statistics()
    turns = rerun.history.steps
    returns |= {"attitudes_too_far_apart": turns.coarse, "attitude_error_deg": round(turns.worst_deg, 1)}
    why = [] if summary["zones"] else [why_no_zone(outcome, rerun.maps(), rerun.parameters)]
    diagnosed = _diagnosed(rerun.diagnosis)
    return summary | {
        "why_no_zones": "; ".join([*why, *(not_mapped(feed, rerun) if why else [])]),
        "lidar_faults": diagnosed["lidar_faults"],
        "warnings": [*lost_for_time(source, returns), *diagnosed["warnings"]],
        "source": source,
        "returns": returns,
    }


def _play(
    steps: Iterator[Step], speed: float, span_s: tuple[float, float], step: Callable[[float, str], None]
) -> bool:
    """Run all steps within a span, at a speed; return whether there was any."""
    begun_ns: int | None = None
    started_s = time.monotonic()
    for at_ns, take in steps:
        begun_ns = at_ns if begun_ns is None else begun_ns
        at_s = (at_ns - begun_ns) * 1e-9
        if at_s > span_s[1]:
            break
        if speed > 0:
            time.sleep(max(0.0, at_s / speed - (time.monotonic() - started_s)))
        report = take(at_s >= span_s[0])
        if report is not None:
            step(at_s, f"{len(report.zones)} zones")
    return begun_ns is not None


def _summary(
    path: Path,
    cut: str,
    o: ReplayOutcome,
    report: Report | None,
    given: tuple[str, ...],
    files: dict[str, str],
) -> dict[str, Any]:
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
        "cut": cut,
        "set": list(given),
        "zones": [] if report is None else [zone_summary(zone, report.frame) for zone in report.zones],
        "choice": None if report is None else choice_summary(report),
        "files": files,
    }


def _diagnosed(diagnosis: LidarDiagnosis | None) -> dict[str, Any]:
    """Return the faults of the LiDAR, and a sentence for each cause."""
    episodes = [] if diagnosis is None else diagnosis.episodes
    lines = dict.fromkeys(f"LiDAR: {episode.explanation.line}" for episode in episodes)
    return {"lidar_faults": [episode.document() for episode in episodes], "warnings": list(lines)}


def _draw(
    out: Path, maps: TerrainMaps | None, report: Report | None, outcome: ReplayOutcome, parameters: Parameters
) -> dict[str, str]:
    from companion.desk.figures import save_flight

    if maps is None or report is None:
        return {}
    chosen = None if report.selected is None else report.selected.enu_m
    flown = np.array(outcome.path_enu_m).reshape(-1, 3)
    files = save_flight(out, maps, report.zones, flown, chosen, None, parameters)
    return {file.stem: str(file) for file in files}
