"""Scans, and their accumulation into time windows (SLZ paper, section 3.1.1)."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, fields, replace
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from slz.frame import LocalFrame, is_known

LATE_NS = 2_000_000_000
MOST_LATE = 100  # scans
EARLY = 0.1  # of the time between two scans
MOST_POINTS = 10_000_000  # points kept in a window whose stamps do not advance
MOST_SCANS = 60_000  # scans kept in a window whose stamps do not advance
MOST_LOST = 1_000_000  # rays without a return kept in a window whose stamps do not advance
LOST_M = 100.0


@dataclass(frozen=True, slots=True)
class PointAttributes:
    """Attributes of returns beyond position, and the rays of the same scan that gave no return.

    intensity : (n,) float32, share of what a white diffuse target would send back, corrected for range; NaN
    where the sensor gives none, or its scale is unknown.
    echo : (n,) uint8, number of the return along its ray (LAS: return number), 1 is the first, 0 unknown.
    echoes : (n,) uint8, number of returns of the ray, 0 unknown.
    lost_enu_m, lost_origin_enu_m : (m, 3) float64, rays that were fired below the horizon and gave no return:
    the point at `LOST_M` along each, and the sensor's position when it was fired. Empty where the sensor does
    not report them.
    lost_weight : (m,) float32, number of rays that each stands for, because drivers thin them.
    """

    intensity: NDArray[np.float32]
    echo: NDArray[np.uint8]
    echoes: NDArray[np.uint8]
    lost_enu_m: NDArray[np.float64] = field(default_factory=lambda: np.empty((0, 3)))
    lost_origin_enu_m: NDArray[np.float64] = field(default_factory=lambda: np.empty((0, 3)))
    lost_weight: NDArray[np.float32] = field(default_factory=lambda: np.empty(0, np.float32))

    def __post_init__(self) -> None:
        n, lost = len(self.intensity), len(self.lost_enu_m)
        for name, array, shape, dtype in (
            ("intensity", self.intensity, (n,), np.float32),
            ("echo", self.echo, (n,), np.uint8),
            ("echoes", self.echoes, (n,), np.uint8),
            ("lost rays", self.lost_enu_m, (lost, 3), np.float64),
            ("origins of lost rays", self.lost_origin_enu_m, (lost, 3), np.float64),
            ("weights of lost rays", self.lost_weight, (lost,), np.float32),
        ):
            if array.shape != shape or array.dtype != dtype:
                raise ValueError(f"{name} must be {shape} {np.dtype(dtype)}, not {_form(array)}")

    @classmethod
    def of(
        cls,
        intensity: NDArray[np.generic],
        echo: NDArray[np.uint8],
        echoes: NDArray[np.uint8],
        *lost: NDArray[Any],
    ) -> Self:
        """Return read-only attributes in which return numbers that contradict each other are unknown.

        lost : `lost_enu_m`, `lost_origin_enu_m` and `lost_weight`, or nothing.
        """
        wrong = (echo == 0) | (echo > echoes)
        if wrong.any():
            echo, echoes = np.where(wrong, np.uint8(0), echo), np.where(wrong, np.uint8(0), echoes)
        found = cls(np.asarray(intensity, np.float32), echo, echoes, *lost)
        for column in fields(found):
            getattr(found, column.name).setflags(write=False)
        return found

    @classmethod
    def unknown(cls, n: int) -> Self:
        """Return the attributes of n returns of a sensor that gives none."""
        none = np.zeros(n, np.uint8)
        return cls.of(np.full(n, np.nan, np.float32), none, none)

    def select(self, which: slice | NDArray[Any]) -> Self:
        """Return the attributes of a selection of the returns, in its order, with all lost rays."""
        return replace(
            self,
            intensity=np.ascontiguousarray(self.intensity[which]),
            echo=np.ascontiguousarray(self.echo[which]),
            echoes=np.ascontiguousarray(self.echoes[which]),
        )

    def __len__(self) -> int:
        return len(self.intensity)


@dataclass(frozen=True, slots=True)
class Scan:
    """Georeferenced returns of one sensor frame.

    points_enu_m : (n, 3) float64, in `frame`. stamp_ns : (n,) int64, the clock of the vehicle computer,
    not decreasing. sensor_enu_m : (3,) float64, sensor position at the last stamp, NaN where unknown.
    attributes : of the n returns, None where the source gives none. open_enu_m : (m, 3) float64, points along
    rays in any direction that gave no return, None where the source does not report them; each stands for
    `open_weight` rays. kinds : (n,) uint8, `slz.airborne.specks.ReturnKind` of each, None if not judged.
    has_thin_rays : whether a ray that passes a place shows that nothing is there.
    """

    points_enu_m: NDArray[np.float64]
    stamp_ns: NDArray[np.int64]
    sensor_enu_m: NDArray[np.float64]
    frame: LocalFrame
    attributes: PointAttributes | None = field(default=None, kw_only=True)
    open_enu_m: NDArray[np.float64] | None = field(default=None, kw_only=True)
    open_weight: float = field(default=1.0, kw_only=True)
    kinds: NDArray[np.uint8] | None = field(default=None, kw_only=True)
    has_thin_rays: bool = field(default=True, kw_only=True)

    def __post_init__(self) -> None:
        n = len(self.stamp_ns)
        if self.points_enu_m.shape != (n, 3) or self.points_enu_m.dtype != np.float64:
            raise ValueError(f"points must be ({n}, 3) float64, not {_form(self.points_enu_m)}")
        if self.stamp_ns.shape != (n,) or self.stamp_ns.dtype != np.int64:
            raise ValueError(f"stamps must be ({n},) int64, not {_form(self.stamp_ns)}")
        if self.sensor_enu_m.shape != (3,):
            raise ValueError(f"sensor position must be (3,), not {_form(self.sensor_enu_m)}")
        if self.attributes is not None and len(self.attributes) != n:
            raise ValueError(f"attributes must be of the {n} points, not of {len(self.attributes)}")

    def select(self, which: NDArray[np.bool_]) -> Scan:
        """Return a scan of some of the returns, in their order."""
        points, stamps = self.points_enu_m[which], self.stamp_ns[which]
        for array in (points, stamps):
            array.setflags(write=False)
        attributes = None if self.attributes is None else self.attributes.select(which)
        kinds = None if self.kinds is None else self.kinds[which]
        return replace(self, points_enu_m=points, stamp_ns=stamps, attributes=attributes, kinds=kinds)

    def __len__(self) -> int:
        return len(self.stamp_ns)


@dataclass(frozen=True, slots=True)
class Window(Scan):
    """Returns of all scans within one time window; same arrays as `Scan`.

    origin : (n,) uint16, the scan of each return, and origins_enu_m : (k, 3), the sensor's position in each
    scan. None where only the last position is known: the angles of the rays are unknown then. thin_origin :
    (k,) bool, `has_thin_rays` of each scan, None for all.
    """

    start_ns: int
    end_ns: int
    origin: NDArray[np.uint16] | None = field(default=None, kw_only=True)
    origins_enu_m: NDArray[np.float64] | None = field(default=None, kw_only=True)
    thin_origin: NDArray[np.bool_] | None = field(default=None, kw_only=True)

    @property
    def sensor_known_m(self) -> NDArray[np.float64]:
        """Writable copy of the sensor's position, as kernels take it; all NaN where it is unknown."""
        return np.array(self.sensor_enu_m if is_known(self.sensor_enu_m) else np.full(3, np.nan), np.float64)

    @property
    def thin_origins_enu_m(self) -> NDArray[np.float64] | None:
        """Positions (k, 3) of the sensors whose rays are thin, NaN for those of others."""
        if self.origins_enu_m is None or self.thin_origin is None:
            return self.origins_enu_m
        return np.where(self.thin_origin[:, np.newaxis], self.origins_enu_m, np.nan)

    def __post_init__(self) -> None:
        Scan.__post_init__(self)
        origin, origins = self.origin, self.origins_enu_m
        if origin is None and origins is None:
            return
        if origin is None or origins is None:
            raise ValueError("origin and origins_enu_m must both be given, or neither")
        if origin.shape != (len(self),) or origin.dtype != np.uint16:
            raise ValueError(f"origin must be ({len(self)},) uint16, not {_form(origin)}")
        if origins.ndim != 2 or origins.shape[1] != 3 or origins.dtype != np.float64:
            raise ValueError(f"origins_enu_m must be (k, 3) float64, not {_form(origins)}")
        if len(origin) and origin.max() >= len(origins):
            raise ValueError(
                f"origin must be below {len(origins)}, the number of origins, not {origin.max()}"
            )


class Windower:
    """Accumulator of scans: closes a window with the scan after which its span is over.

    A window holds the scans that begin within `window_s` of its first one (SLZ thesis, section 3.2.1.1). The
    next scan is expected to begin as long after the newest as that began after the one before, or `EARLY` of
    this sooner; if that is beyond the window's end, the window is closed without waiting for it. One that
    comes later than expected is the last of the window, or begins the next one if it is later than a second
    span.
    While nobody awaits a window, it grows up to `longest_s`.
    Stamps decide, not arrival times. Scans of a second sensor may be late by up to `LATE_NS`: they join the
    open window or wait for the next, and neither open nor close one. An older scan means that the clock went
    back, and starts a window.
    """

    def __init__(self, window_s: float, longest_s: float = 0.0) -> None:
        self.window_s, self.longest_s = window_s, longest_s
        self._scans: list[Scan] = []
        self._late: list[Scan] = []
        self._first_ns = 0  # of the scan that opened the window
        self._newest_ns: int | None = None  # where the newest scan in order began
        self._period_ns = 0  # between the newest two
        self._last: Window | None = None

    def add(self, scan: Scan, *, is_awaited: bool = True) -> tuple[Window, ...]:
        """Add a scan; return the windows that are over: before it, and with it."""
        if not len(scan):
            return ()
        span_s = self.window_s if is_awaited else max(self.window_s, self.longest_s)
        ended = self.flush() if self._scans and self._must_close(scan, span_s) else None
        if self._scans:
            self._scans.append(scan)
        elif ended is None and self._is_late(scan):
            self._late.append(scan)
            return ()
        else:
            self._scans = [*(late for late in self._late if late.frame == scan.frame), scan]
            self._first_ns, self._late = int(scan.stamp_ns[0]), []
            if ended is not None or (self._newest_ns or 0) > self._first_ns:
                self._newest_ns = None  # its interval to the one before is no evidence for the next
        if not self._follow(scan):
            return ()
        whole = self.flush() if self.is_over(span_s) else None
        return tuple(window for window in (ended, whole) if window is not None)

    def is_over(self, span_s: float) -> bool:
        """Return whether the open window, if any, would hold the next scan for longer than a span."""
        next_ns = (self._newest_ns or 0) + (1 + EARLY) * self._period_ns
        return self.is_open and next_ns - self._first_ns >= round(span_s * 1e9)

    @property
    def is_open(self) -> bool:
        """True if scans are held that wait for others."""
        return bool(self._scans)

    def _follow(self, scan: Scan) -> bool:
        """Note when a scan began, and how long after the one before; return whether it is in order."""
        began_ns, before_ns = int(scan.stamp_ns[0]), self._newest_ns
        if before_ns is None:
            self._period_ns = int(scan.stamp_ns[-1]) - began_ns
        elif began_ns < before_ns:
            return False
        else:
            self._period_ns = began_ns - before_ns
        self._newest_ns = began_ns
        return True

    def _must_close(self, scan: Scan, span_s: float) -> bool:
        elapsed = int(scan.stamp_ns[0]) - self._first_ns
        over = elapsed >= round(2 * span_s * 1e9) or sum(map(len, self._scans)) >= MOST_POINTS
        over = over or sum(map(_lost, self._scans)) >= MOST_LOST or len(self._scans) >= MOST_SCANS
        return over or elapsed < -LATE_NS or scan.frame != self._scans[-1].frame

    def _is_late(self, scan: Scan) -> bool:
        """Return whether a scan is late: it begins at most `LATE_NS` before the end of the last window."""
        if self._last is None or scan.frame != self._last.frame or len(self._late) >= MOST_LATE:
            return False
        return -LATE_NS <= int(scan.stamp_ns[0]) - self._last.end_ns < 0

    def flush(self) -> Window | None:
        """Return the open window, complete or not, and discard the late scans that wait for the next."""
        self._late = []
        if not self._scans:
            return None
        window = join(self._scans)
        self._scans, self._last = [], window
        return window


def join(scans: Iterable[Scan]) -> Window:
    """Join scans of one frame into a window, in the order given; stamps of two sensors may interleave.

    Returns of scans without attributes get unknown ones, if any scan has attributes.
    """
    scans = list(scans)
    newest = max(scans, key=lambda scan: int(scan.stamp_ns[-1]) if len(scan) else -1)
    stamps = np.concatenate([scan.stamp_ns for scan in scans])
    points = np.concatenate([scan.points_enu_m for scan in scans])
    points.setflags(write=False)
    stamps.setflags(write=False)
    return Window(
        points_enu_m=points,
        stamp_ns=stamps,
        sensor_enu_m=newest.sensor_enu_m,
        frame=newest.frame,
        start_ns=int(stamps.min()),
        end_ns=int(stamps.max()),
        attributes=_attributes(scans),
        origin=np.repeat(np.arange(len(scans), dtype=np.uint16), [len(scan) for scan in scans]),
        origins_enu_m=np.array([scan.sensor_enu_m for scan in scans], np.float64),
        thin_origin=np.array([scan.has_thin_rays for scan in scans]),
    )


def join_attributes(parts: Sequence[PointAttributes]) -> PointAttributes:
    """Return the attributes of all returns of `parts`, at least one, in their order, and all lost rays."""
    columns = (column.name for column in fields(PointAttributes))
    return PointAttributes.of(*(np.concatenate([getattr(part, name) for part in parts]) for name in columns))


def _attributes(scans: Sequence[Scan]) -> PointAttributes | None:
    if all(scan.attributes is None for scan in scans):
        return None
    return join_attributes([_known(scan) for scan in scans])


def _known(scan: Scan) -> PointAttributes:
    return PointAttributes.unknown(len(scan)) if scan.attributes is None else scan.attributes


def _lost(scan: Scan) -> int:
    return 0 if scan.attributes is None else len(scan.attributes.lost_enu_m)


def _form(array: NDArray[np.generic]) -> str:
    return f"{array.shape} {array.dtype}"
