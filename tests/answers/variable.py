"""Run-dependent values that the record leaves out: one table, with the reasons."""

from __future__ import annotations

import fnmatch
from dataclasses import dataclass
from pathlib import Path

from tests.answers.tree import Tree

REMOVED = "(left out)"


@dataclass(frozen=True)
class Variable:
    """A value left out of the record.

    answer, path: patterns of the answer's name and of the key path, as of `fnmatch`; the path of a whole
    answer is empty. A path that begins with NAMED_VALUE_FLOAT names a value in the MAVLink stream.
    """

    answer: str
    path: str
    reason: str


VARIABLE = (
    Variable("*", "latency_ms", "processing time by the wall clock"),
    Variable("*", "latency_ms.*", "processing time by the wall clock"),
    Variable("*", "wall_s", "duration by the wall clock"),
    Variable("map/*", "seconds", "duration by the wall clock"),
    Variable("map/*", "stage_ms.*", "processing time by stage"),
    Variable("map/*", "query_ms", "processing time"),
    Variable("bench/*", "ms.*", "processing time"),
    Variable("bench/*", "cpu_ms.*", "processing time"),
    Variable("bench/*", "between_ms.*", "processing time"),
    Variable("bench/*", "window_ms", "processing time"),
    Variable("bench/*", "stage_ms.*", "processing time"),
    Variable("bench/*", "points_per_s", "processing time"),
    Variable("bench/*", "rss_mb", "memory of the process"),
    Variable("reproduce/figures", "scenes.*.ms_*", "processing time"),
    Variable("reproduce/figures", "odometry.*.ms_*", "processing time"),
    Variable("reproduce/figures", "radar.elapsed_s", "processing time"),
    Variable("reproduce/files/index.md", "*.ms per 1 s, median / max", "processing time"),
    Variable("reproduce/files/index.md", "Time per window*.median", "processing time"),
    Variable("reproduce/files/index.md", "Time per window*.p99", "processing time"),
    Variable("reproduce/files/index.md", "Time per window*.greatest", "processing time"),
    Variable("reproduce/files/index.md", "*.update, median / p95 ms", "processing time"),
    Variable("reproduce/files/index.md", "*.time of all four and fusing, s.*", "processing time"),
    Variable("reproduce/files/index.html", "", "the page of index.md, which is recorded by its values"),
    Variable("reproduce/files/time_per_window.png", "", "picture of processing times"),
    Variable("flights/*", "*.stage_ms", "processing time by stage"),
    Variable("flights/*", "NAMED_VALUE_FLOAT.SLZ_LATE", "processing time of the last scan, ms"),
)
MAVLINK = "NAMED_VALUE_FLOAT."


def variable_values() -> frozenset[str]:
    """Return the names of the NAMED_VALUE_FLOATs whose value is left out."""
    return frozenset(one.path.removeprefix(MAVLINK) for one in VARIABLE if one.path.startswith(MAVLINK))


def normalised(answer: str, tree: Tree, folders: dict[Path, str]) -> Tree:
    """Return a tree without what must differ from run to run.

    folders: temporary folders and the names that stand for them in every text.
    """
    patterns = [one.path for one in VARIABLE if fnmatch.fnmatchcase(answer, one.answer)]
    texts = [(str(folder), name) for folder, name in folders.items()]
    return _normalised(tree, "", patterns, texts)


def _normalised(tree: Tree, path: str, patterns: list[str], texts: list[tuple[str, str]]) -> Tree:
    if any(fnmatch.fnmatchcase(path, pattern) for pattern in patterns):
        return REMOVED
    if isinstance(tree, dict):
        return {
            key: _normalised(value, f"{path}.{key}" if path else str(key), patterns, texts)
            for key, value in tree.items()
        }
    if isinstance(tree, list):
        return [_normalised(value, f"{path}[*]", patterns, texts) for value in tree]
    if isinstance(tree, str):
        for folder, name in texts:
            tree = tree.replace(folder, name)
    return tree
