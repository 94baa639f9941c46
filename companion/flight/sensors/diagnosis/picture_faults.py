"""Faults in the picture of a stream: sectors without packets or returns, dead lines, a dirty window."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from companion.flight.sensors.diagnosis import explanation as explain
from companion.flight.sensors.diagnosis.close_returns import CloseReturns
from companion.flight.sensors.diagnosis.explanation import Explanation
from companion.flight.sensors.diagnosis.packet_signs import PacketSigns
from companion.flight.sensors.diagnosis.return_picture import LINES, SECTOR_DEG, SECTORS
from companion.flight.sensors.diagnosis.stream_look import StreamLook

LEAST_PACKETS = 4  # in each part of the circle, in the mean, before one without any counts as missing
NEAR_SHARE, LEAST_NEAR, NEAR_SECTORS = 0.1, 6, 2
BLIND_BEFORE, BLIND_SHARE, BLIND_SECTORS = 30, 0.05, (2, 9)
BESIDE, BESIDE_SHARE = 2, 0.5
LINE_BESIDE, LINES_DEAD = 12, 0.25
FEW_LINES = 4

Counts = NDArray[np.int64]
Floats = NDArray[np.float64]


def longest_run(marked: NDArray[np.bool_]) -> tuple[int, int] | None:
    """Return first index and length of the longest run, which may pass the end; None without a mark.

    marked: (n,), the last beside the first.
    """
    n = len(marked)
    if not marked.any():
        return None
    if marked.all():
        return 0, n
    start = int(np.argmin(marked))  # not marked, so no run passes the seam
    turned = np.concatenate(([False], np.roll(marked, -start), [False])).astype(np.int8)
    edges = np.diff(turned)
    first, end = np.flatnonzero(edges == 1), np.flatnonzero(edges == -1)
    k = int(np.argmax(end - first))
    return (int(first[k]) + start) % n, int(end[k] - first[k])


def missing_sector(look: StreamLook, signs: PacketSigns) -> Explanation | None:
    """Return which azimuths no packet is of, while those beside them come."""
    packets = look.azimuth_packets
    if not len(packets) or packets.sum() < LEAST_PACKETS * len(packets):
        return None
    first_deg, part_deg = signs.azimuth_deg
    run = longest_run(packets == 0)
    if run is None or run[1] * part_deg < SECTOR_DEG or run[1] < np.count_nonzero(packets == 0):
        return None
    from_deg = first_deg + run[0] * part_deg
    return explain.missing_sector(from_deg % 360, (from_deg + run[1] * part_deg) % 360)


def dirty_window(look: StreamLook, close: CloseReturns) -> Explanation | None:
    """Return where returns of the window itself are frequent; None where the ground is as near."""
    marked = (look.near >= LEAST_NEAR) & (look.near > NEAR_SHARE * look.seen)
    run = longest_run(marked)
    if run is None or run[1] < NEAR_SECTORS or close.is_ground(look, _about(run)):
        return None
    return explain.dirty(*_degrees(run))


def covered_sector(look: StreamLook, usual: Floats, close: CloseReturns) -> Explanation | None:
    """Return where returns have ended while those at both sides go on.

    usual: (36,) returns of the same time before.
    """
    run = longest_run((look.seen <= BLIND_SHARE * usual) & (usual >= BLIND_BEFORE))
    if run is None or not BLIND_SECTORS[0] <= run[1] <= BLIND_SECTORS[1]:
        return None
    if close.is_ground(look, _about(run)):  # which may be below the sensor's least range
        return None
    first, length = run
    beside = np.array([*range(first - BESIDE, first), *range(first + length, first + length + BESIDE)])
    now, before = look.seen[beside % SECTORS], usual[beside % SECTORS]
    if (before < BLIND_BEFORE).any() or (now < BESIDE_SHARE * before).any():
        return None
    return explain.covered(*_degrees(run))


def dead_lines(look: StreamLook, ever: Counts, signs: PacketSigns) -> Explanation | None:
    """Return laser lines without returns between lines that have them; ever: (256,) of all time."""
    known = int(np.flatnonzero(ever)[-1]) + 1 if ever.any() else 0
    if not signs.lines:  # each line sees all the view
        known = FEW_LINES
        dead = look.lines[:known] == 0
        alive = look.lines[:known][~dead]
        good = 0 < dead.sum() < known and alive.min() >= LINE_BESIDE
    else:
        dead = look.lines[:known] == 0
        lit = np.flatnonzero(~dead)
        if len(lit) < 2:
            return None
        dead[: lit[0]] = dead[lit[-1] :] = False  # outside: they may look at the sky
        rows = np.flatnonzero(dead)
        beside = np.concatenate([lit[np.searchsorted(lit, rows) - 1], lit[np.searchsorted(lit, rows)]])
        good = 0 < len(rows) <= LINES_DEAD * known and (look.lines[beside] >= LINE_BESIDE).all()
    return explain.missing_rows(np.flatnonzero(dead).tolist()) if good and known <= LINES else None


def _about(run: tuple[int, int]) -> NDArray[np.intp]:
    """Return the sectors of a run and those beside it."""
    return np.unique(np.arange(run[0] - BESIDE, run[0] + run[1] + BESIDE) % SECTORS)


def _degrees(run: tuple[int, int]) -> tuple[float, float]:
    return run[0] * SECTOR_DEG, (run[0] + run[1]) * SECTOR_DEG % 360
