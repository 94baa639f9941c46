"""Run of the benchmark: every method on every flight of every case, scored and timed."""

from __future__ import annotations

import json
import platform
import time
import traceback
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from companion.desk.open_benchmark import leaderboard
from companion.desk.open_benchmark.benchmark_case import (
    VERSION,
    BenchmarkCase,
    chosen_scenes,
    frozen_cases,
    frozen_names,
)
from companion.desk.open_benchmark.classified_cloud import classified_case
from companion.desk.open_benchmark.exchange_folder import SCENE_FILE, read_case, write_case
from companion.desk.open_benchmark.frozen_scenes import DENSITIES
from companion.desk.open_benchmark.landing_task import (
    UNKNOWN,
    FlownReturns,
    LandingMethod,
    LandingTask,
    SafeMap,
)
from companion.desk.open_benchmark.methods import METHODS, REFERENCE, method_of_file
from companion.desk.open_benchmark.safe_map_files import read_safe_map
from companion.desk.open_benchmark.safe_map_score import SafeMapCounts, score
from companion.runtime import output_folder
from companion.runtime.errors import CompanionError, UsageError

Progress = Callable[[str, float], None]
KNOWN = (*METHODS, REFERENCE)
FROZEN_FLIGHTS = frozenset(map(str, DENSITIES))
TIMING = (
    "processor time of all threads for one call of judge, from the points in memory to the map; one call on"
    " the first flight before goes untimed; median over the flights of a density"
)


@dataclass(frozen=True, slots=True)
class BenchmarkChoice:
    """Selection of a run: methods, words of scenes' names, more methods, other scenes and their CRS."""

    methods: tuple[str, ...] = ()
    method_files: tuple[Path, ...] = ()
    scenes: tuple[str, ...] = ()
    densities: tuple[int, ...] = DENSITIES
    folders: tuple[Path, ...] = ()
    classified: tuple[Path, ...] = ()
    crs: str | None = None

    def chosen_methods(self) -> list[LandingMethod]:
        """Return the methods of the files, and the named ones of the benchmark, all without a name.

        Raises
        ------
        UsageError
            A name is of no method or of several, or two methods have one name.
        """
        named = [_method_named(name) for name in self.methods]
        chosen = [method for method in KNOWN if method in named or not named]
        own = [method_of_file(path) for path in self.method_files]
        names = [method.name for method in (*own, *chosen)]
        doubled = next((name for name in names if names.count(name) > 1), None)
        if doubled is not None:
            raise UsageError(f"two methods are named {doubled!r}: rename yours")
        return [*own, *chosen]

    def cases(self, with_flights: bool = True) -> Iterator[tuple[int, int, BenchmarkCase]]:
        """Yield number, count and case: frozen ones, those of folders, then classified surveys.

        Raises
        ------
        UsageError
            A choice names nothing, a scene cannot be read, or two have one name.
        """
        names: set[str] = set()
        for number, total, case in self._cases(with_flights):
            if case.name in names:
                raise UsageError(f"two scenes are named {case.name!r}: rename one")
            names.add(case.name)
            yield number, total, case

    def _cases(self, with_flights: bool) -> Iterator[tuple[int, int, BenchmarkCase]]:
        only_others = (self.folders or self.classified) and not self.scenes
        frozen = [] if only_others else chosen_scenes(self.scenes)
        folders = [found for folder in self.folders for found in _scene_folders(folder)]
        total, number = len(frozen) + len(folders) + len(self.classified), 0
        for case in frozen_cases(frozen, self.densities if with_flights else ()):
            yield number, total, case
            number += 1
        for folder in folders:
            yield number, total, read_case(folder, with_flights)
            number += 1
        for path in self.classified:
            yield number, total, classified_case(path, self.crs)
            number += 1


@dataclass(slots=True)
class MethodRow:
    """Counts and times of a method by group: pulses per m², or the label of other flights."""

    name: str
    source: str
    counts: dict[str, SafeMapCounts] = field(default_factory=dict)
    ms: dict[str, list[float]] = field(default_factory=dict)

    def add(self, group: str, counts: SafeMapCounts, ms: float) -> None:
        self.counts.setdefault(group, SafeMapCounts()).add(counts)
        self.ms.setdefault(group, []).append(ms)

    def document(self) -> dict[str, Any]:
        """Return the figures as JSON."""
        groups = {
            group: counts.figures() | {"ms": round(float(np.median(self.ms[group])), 1)}
            for group, counts in self.counts.items()
        }
        return {"name": self.name, "source": self.source, "groups": groups}


def run(out: Path, progress: Progress, choice: BenchmarkChoice) -> dict[str, Any]:
    """Run the methods and write results.json, scenes.csv and the leaderboard; return the summary.

    Raises
    ------
    UsageError
        A choice names nothing.
    CompanionError
        A method fails, or its map is not one of the task.
    """
    methods = choice.chosen_methods()
    output_folder.prepare(out)
    rows = {method.name: MethodRow(method.name, method.source) for method in methods}
    warm: set[str] = set()
    scenes: list[dict[str, Any]] = []
    changed: list[str] = []
    others: list[str] = []
    unfrozen: dict[str, None] = {}
    begun = time.perf_counter()
    for number, total, case in choice.cases():
        progress(case.name, number / total)
        if case.digests_agree is False:
            changed.append(case.name)
        if case.digests_agree is None:
            others.append(case.name)
        else:
            unfrozen |= dict.fromkeys(label for label in case.flights if label not in FROZEN_FLIGHTS)
        for label, flown in case.flights.items():
            returns, place = _read_only(flown), f"scene {case.name}, flight {label}"
            for method in methods:
                if method.name not in warm:
                    _judged(method, returns, case.task, place)
                    warm.add(method.name)
                cpu = time.process_time()
                answer = _judged(method, returns, case.task, place)
                ms = 1e3 * (time.process_time() - cpu)
                counts = score(answer, case.truth)
                rows[method.name].add(label, counts, ms)
                one = {"scene": case.name, "flight": label, "method": method.name, "ms": round(ms, 1)}
                scenes.append(one | counts.figures())
    if not scenes:
        raise UsageError("nothing to judge: the chosen scenes have no flight")
    document = {
        "benchmark": "slz benchmark",
        "version": VERSION,
        "scenes": len({one["scene"] for one in scenes}),
        "frozen_scenes": len({one["scene"] for one in scenes} - set(others)),
        "frozen_scenes_of_version": len(frozen_names()),
        "other_scenes": others,
        "not_as_frozen": changed,
        "flights_without_digest": list(unfrozen),
        "timing": TIMING,
        "machine": f"{platform.machine()}, Python {platform.python_version()}",
        "seconds": round(time.perf_counter() - begun, 1),
        "methods": [row.document() for row in rows.values()],
    }
    files = [out / "results.json", *leaderboard.write(out, document, scenes)]
    files[0].write_text(json.dumps(document | {"by_scene": scenes}, indent=1) + "\n", "utf-8")
    return document | {"files": [str(path) for path in files]}


def export(out: Path, progress: Progress, choice: BenchmarkChoice, cloud_format: str) -> dict[str, Any]:
    """Write the chosen cases as files of the exchange format, and return their names and number."""
    output_folder.prepare(out)
    names, changed, n_files = [], [], 0
    for number, total, case in choice.cases():
        progress(case.name, number / total)
        n_files += len(write_case(case, out, cloud_format))
        names.append(case.name)
        if case.digests_agree is False:
            changed.append(case.name)
    return {
        "out": str(out),
        "version": VERSION,
        "scenes": names,
        "not_as_frozen": changed,
        "files": n_files,
    }


def score_file(path: Path, name: str, choice: BenchmarkChoice, safe_from: float | None) -> dict[str, Any]:
    """Score one map or file of zones against one scene, and return its figures.

    A scene of the chosen folders and classified files comes before a frozen one of the same name.
    `as_frozen` is whether closed form and truth are those of the manifest, None for other scenes.

    Raises
    ------
    UsageError
        There is no such scene, or the file cannot be scored.
    """
    case = _named(name, choice)
    named = {"file": str(path), "scene": case.name, "as_frozen": case.digests_agree}
    return named | score(read_safe_map(path, case, safe_from), case.truth).figures()


def _method_named(name: str) -> LandingMethod:
    """Return the method of this name, or the only one whose name holds it, in its case or in any."""
    found = (
        [method for method in KNOWN if name == method.name]
        or [method for method in KNOWN if name in method.name]
        or [method for method in KNOWN if name.lower() in method.name.lower()]
    )
    if len(found) == 1:
        return found[0]
    there = "; ".join(method.name for method in found or KNOWN)
    raise UsageError(
        f"--method {name!r} is {'of several methods' if found else 'no method'}: there are {there}"
    )


def _named(name: str, choice: BenchmarkChoice) -> BenchmarkCase:
    for folder in (found for place in choice.folders for found in _scene_folders(place)):
        if folder.name == name:
            return read_case(folder, with_flights=False)
    for path in choice.classified:
        if path.stem == name:
            return classified_case(path, choice.crs)
    if name in frozen_names():
        wanted = [scene for scene in chosen_scenes((name,)) if scene.name == name]
        return next(frozen_cases(wanted, ()))
    raise UsageError(f"no scene is named {name!r}: slz benchmark --list names them all")


def _scene_folders(folder: Path) -> list[Path]:
    found = sorted(path.parent for path in (*folder.glob(SCENE_FILE), *folder.glob(f"*/{SCENE_FILE}")))
    if not found:
        raise UsageError(f"--scenes {folder}: it holds no folder with a {SCENE_FILE}")
    return found


def _read_only(returns: FlownReturns) -> FlownReturns:
    """Return a copy that a method cannot change, so that every method judges the same returns."""
    arrays = (returns.points_m, returns.stamp_s, returns.window, returns.sensors_m)
    return FlownReturns(*(_locked(values) for values in arrays))


def _locked(values: NDArray[Any]) -> NDArray[Any]:
    """Return a copy in bytes, which cannot be made writable."""
    return np.frombuffer(values.tobytes(), values.dtype).reshape(values.shape)


def _judged(method: LandingMethod, returns: FlownReturns, task: LandingTask, place: str) -> SafeMap:
    """Return a method's answer, checked; place: scene and flight, for errors."""
    try:
        answer = method.judge(returns, task)
        states = np.asarray(answer.state)
        probability = None if answer.probability is None else np.asarray(answer.probability, np.float32)
        share = None if answer.limit_share is None else np.asarray(answer.limit_share, np.float32)
    except CompanionError:
        raise
    except (Exception, SystemExit) as error:
        raise CompanionError(f"method {method.name!r} {_failure(error)} ({place})") from error
    shape, whose = task.grid.shape, f"method {method.name!r}, {place}: its"
    if states.shape != shape or not np.isin(states, (0, 1, UNKNOWN)).all():
        raise CompanionError(f"{whose} states must be {shape} of 0, 1 and 255")
    if probability is not None:
        known = probability[~np.isnan(probability)]
        if probability.shape != shape or (len(known) and (known.min() < 0 or known.max() > 1)):
            raise CompanionError(f"{whose} probabilities must be {shape} of 0 to 1")
    if share is not None and (share.shape != shape or (share < 0).any()):
        raise CompanionError(f"{whose} shares must be {shape} of 0 and more")
    return SafeMap(states.astype(np.uint8), probability, share)


def _failure(error: Exception | SystemExit) -> str:
    """Return the failure, and the last line of the method's own file that led there."""
    line = " ".join(f"{type(error).__name__}: {error}".split())[:160]
    frames = traceback.extract_tb(error.__traceback__)[1:]  # without the call of `judge`
    own = [frame for frame in frames if frame.filename == frames[0].filename]
    at = f" at {own[-1].filename}:{own[-1].lineno}" if own else ""
    if isinstance(error, ValueError) and "read-only" in str(error):
        return f"changes its input{at}, which is read-only: copy it first: {line}"
    return f"fails{at}: {line}"


def names_of(methods: Sequence[LandingMethod]) -> list[dict[str, str]]:
    """Return names and sources of methods as JSON."""
    return [{"name": method.name, "source": method.source} for method in methods]
