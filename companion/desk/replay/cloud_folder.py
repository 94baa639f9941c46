"""Folder of PCD scans named by their times, as the points of a telemetry log."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

from companion.desk.clouds.crs import from_option
from companion.desk.clouds.pcd import open_pcd
from companion.desk.replay.foreign_replay import Act, Rerun
from companion.desk.replay.recorder_clock import ClockStep, continuous_time
from companion.flight.sensors.decoders.point_clock import PointClock
from companion.flight.sensors.decoders.point_cloud import Decoded, StampedCloud, clock_of, decode
from companion.runtime.errors import UsageError

# Unit of a whole number since 1970, from its number of digits in this century.
UNITS_NS = {10: 1_000_000_000, 13: 1_000_000, 16: 1_000, 19: 1}
NAME = re.compile(r"(\d{10,19})(?:[._](\d{1,9}))?")
EXAMPLE = "1763000000.123456789.pcd, seconds since 1970"
WHOLE_DIGITS = frozenset({3, 6, 9})  # digits of the largest whole number of ms, us, ns in a second
EITHER = WHOLE_DIGITS | {1, 2}  # lengths that are unambiguous if all fractions share them

_NOWHERE = from_option("EPSG:4326")  # the reader requires a CRS, though the points are in the sensor's axes


class CloudFolder:
    """Scans in the sensor's axes (forward, left, up); see `LoggedPoints`.

    Points have the time of their file's name, or their own time if a field holds it as in the clouds of a
    bag.

    Raises
    ------
    UsageError
        The folder holds no scan, or a name is no time.
    """

    cut = ""
    bad = 0

    def __init__(self, folder: Path) -> None:
        paths = sorted(folder.glob("*.pcd"))
        if not paths:
            raise UsageError(f"{folder}: it holds no .pcd file")
        self._files = sorted(zip(stamps_of(paths), paths, strict=True))
        self._counts = CloudCounts()
        self._clock = clock_of(_read(*file) for file in self._files)

    def summary(self) -> dict[str, Any]:
        return self._counts.summary(self._clock)

    def steps(self, rerun: Rerun, clock_steps: Sequence[ClockStep]) -> Iterator[tuple[int, Act]]:
        self._counts = CloudCounts()
        recorded = continuous_time(clock_steps, [stamp_ns for stamp_ns, _ in self._files])
        for stamp_ns, path in self._files:
            at_ns = recorded(stamp_ns)
            yield at_ns, partial(self._hand, rerun, stamp_ns, at_ns - stamp_ns, path)

    def _hand(self, rerun: Rerun, stamp_ns: int, later_ns: int, path: Path) -> None:
        clock = self._clock if isinstance(self._clock, PointClock) else None
        decoded = decode(_read(stamp_ns, path).table, stamp_ns, clock)
        if self._counts.add(decoded, clock):
            rerun.add_returns(replace(decoded.returns, stamp_ns=decoded.returns.stamp_ns + later_ns))


@dataclass(slots=True)
class CloudCounts:
    """Counts of clouds, clouds without point times, and omitted points; see `Decoded`, `StampedCloud`."""

    clouds: int = 0
    clouds_without_point_times: int = 0
    points_without_return: int = 0
    points_with_false_times: int = 0
    points_of_low_confidence: int = 0

    def add(self, decoded: Decoded, clock: PointClock | None, doubtful: int = 0) -> bool:
        """Count a cloud; return whether it is used: one whose times are unlike those of the others is not."""
        self.clouds += 1
        self.clouds_without_point_times += not decoded.timed
        self.points_without_return += decoded.no_return
        self.points_with_false_times += decoded.false_times
        self.points_of_low_confidence += doubtful
        return decoded.timed or clock is None

    def summary(self, clock: PointClock | str) -> dict[str, Any]:
        """Return the counts and the meaning of point times, or the reason they are unused, for JSON."""
        known = isinstance(clock, PointClock)
        times = {"point_times": str(clock) if known else None, "why_no_point_times": "" if known else clock}
        return asdict(self) | times


def _read(stamp_ns: int, path: Path) -> StampedCloud:
    return StampedCloud(stamp_ns, "", open_pcd(path, _NOWHERE, in_sensor_axes=True).records())


def stamps_of(paths: Sequence[Path]) -> list[int]:
    """Return the times in the names of files, ns since 1970.

    Raises
    ------
    UsageError
        A name is no time, or the meaning of the fractions is ambiguous.
    """
    parts = [_parts(path) for path in paths]
    digits = _whole_digits(paths, [fraction for _, fraction in parts if fraction])
    return [begin_ns + _fraction_ns(fraction, digits) for begin_ns, fraction in parts]


def _parts(path: Path) -> tuple[int, str]:
    """Return the whole number of a name (ns) and the digits of its fraction of a second."""
    found = NAME.fullmatch(path.stem)
    unit_ns = UNITS_NS.get(len(found[1])) if found else None
    if found is None or unit_ns is None or (found[2] and unit_ns != UNITS_NS[10]):
        raise UsageError(f"{path}: its name is no time: write {EXAMPLE}")
    return int(found[1]) * unit_ns, found[2] or ""


def _whole_digits(paths: Sequence[Path], fractions: list[str]) -> int | None:
    """Return the number of digits of a full second if fractions are whole numbers; None for decimals."""
    lengths = {len(fraction) for fraction in fractions}
    if not lengths or (len(lengths) == 1 and lengths <= EITHER):
        return None
    several = [fraction for fraction in fractions if len(fraction) > 1]
    before, behind = (any(test(one, "0") for one in several) for test in (str.startswith, str.endswith))
    if before and (len(lengths) == 1 or not behind):
        return None
    if behind and not before and len(lengths) > 1 and max(lengths) in WHOLE_DIGITS:
        return max(lengths)
    shorter = next(path for path in paths if len(_parts(path)[1]) == min(lengths))
    raise UsageError(
        f"{shorter}: nobody can tell whether the {min(lengths)} to {max(lengths)} digits after the seconds in"
        " this folder's names are decimals or nanoseconds: write all with nine, leading zeros too"
    )


def _fraction_ns(fraction: str, whole_digits: int | None) -> int:
    padded = fraction.ljust(9, "0") if whole_digits is None else fraction.zfill(whole_digits).ljust(9, "0")
    return int(padded)
