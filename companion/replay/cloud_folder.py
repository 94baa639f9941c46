"""A folder of PCD files, one of each scan and named by its time, beside a telemetry log."""

from __future__ import annotations

import re
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from companion.errors import UsageError
from companion.replay.rerun import Act, Rerun
from companion.sensors.returns import Returns
from companion.survey.pcd import open_pcd
from companion.survey.reference import from_option

# What a whole number since 1970 counts, by its digits in this century.
UNITS_NS = {10: 1_000_000_000, 13: 1_000_000, 16: 1_000, 19: 1}
NAME = re.compile(r"(\d{10,19})(?:[._](\d{1,9}))?")
EXAMPLE = "1763000000.123456789.pcd, seconds since 1970"


class CloudFolder:
    """Scans in the sensor's axes (forward, left, up); see `LoggedPoints`.

    All points of a file have its time, so they are not de-skewed.

    Raises
    ------
    UsageError
        There is none, or a name is no time.
    """

    cut = ""
    bad = 0

    def __init__(self, folder: Path) -> None:
        self._files = sorted((stamp_of(path), path) for path in folder.glob("*.pcd"))
        if not self._files:
            raise UsageError(f"{folder}: it holds no .pcd file")
        open_pcd(self._files[0][1], _NOWHERE)

    def told(self) -> dict[str, Any]:
        return {"clouds": len(self._files), "clouds_without_point_times": len(self._files)}

    def steps(self, rerun: Rerun) -> Iterator[tuple[int, Act]]:
        for stamp_ns, path in self._files:
            yield stamp_ns, partial(self._hand, rerun, stamp_ns, path)

    def _hand(self, rerun: Rerun, stamp_ns: int, path: Path) -> None:
        pieces = [chunk.points for chunk in open_pcd(path, _NOWHERE).chunks()]
        points = np.concatenate(pieces).astype(np.float32)
        n = len(points)
        nothing, one = np.zeros(n, np.uint8), np.ones(n, np.uint8)
        rerun.add_returns(
            Returns(points, np.full(n, stamp_ns, np.int64), nothing, nothing.copy(), one, one.copy())
        )


def stamp_of(path: Path) -> int:
    """Return the time that a file is named by, ns since 1970.

    Raises
    ------
    UsageError
        The name is no time.
    """
    found = NAME.fullmatch(path.stem)
    unit_ns = UNITS_NS.get(len(found[1])) if found else None
    if found is None or unit_ns is None or (found[2] and unit_ns != UNITS_NS[10]):
        raise UsageError(f"{path}: its name is no time: write {EXAMPLE}")
    return int(found[1]) * unit_ns + int((found[2] or "").ljust(9, "0"))


_NOWHERE = from_option("EPSG:4326")  # a reader wants one; the points are the sensor's
