"""Measures of scripted flights, by the truth and on the autopilot's clock."""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from tests.opinion.scripted_flight import SPEED_MS, STEP_M

F64 = NDArray[np.float64]
EARTH_M_PER_DEG = 111_194.9
SETTLED_M, SETTLED_MS = 0.3, 0.15


@dataclass(frozen=True, slots=True)
class Record:
    """Flight: times (n,), truth and estimate (n, ...), and the time at which each phase begins."""

    time_s: F64
    place_m: F64
    """North, east, up from the first sample."""
    speed_ms: F64
    """North, east, up."""
    angles_deg: F64
    rates_deg_s: F64
    estimate_m: F64
    """North, east, up."""
    marks: dict[str, float]

    @classmethod
    def read(cls, path: Path) -> Record:
        """Read a record of `scripted_flight`."""
        kept = json.loads(path.read_text("utf-8"))
        rows = np.array(kept["rows"], np.float64)
        north, east = (rows[:, 1:3] - rows[0, 1:3]).T * EARTH_M_PER_DEG
        east = east * math.cos(math.radians(rows[0, 1]))
        return cls(
            rows[:, 0],
            np.column_stack([north, east, rows[:, 3] - rows[0, 3]]),
            rows[:, 4:7] * (1, 1, -1),
            np.degrees(rows[:, 7:10]),
            np.degrees(rows[:, 10:13]),
            rows[:, 13:16] * (1, 1, -1),
            dict(kept["marks"]),
        )

    def within(self, name: str, seconds: float) -> slice:
        """Return the samples of some seconds from the beginning of a phase."""
        begin = self.marks[name]
        first, last = np.searchsorted(self.time_s, (begin, begin + seconds))
        return slice(int(first), int(last))


def run(paths: Sequence[Path]) -> int:
    """Print a table of the flights."""
    columns = [measures(Record.read(path)) for path in paths]
    print("| measure | " + " | ".join(path.stem for path in paths) + " |\n|" + "---|" * (len(paths) + 1))
    for name in columns[0]:
        print(f"| {name} | " + " | ".join(column[name] for column in columns) + " |")
    return 0


def measures(record: Record) -> dict[str, str]:
    """Return the measures of a flight by name."""
    return _hover(record) | _climb(record) | _steps(record) | _turn(record) | _landing(record)


def _climb(r: Record) -> dict[str, str]:
    own = slice(int(np.searchsorted(r.time_s, r.marks["climb"])), r.within("hover", 0.0).start)
    up, speed = r.place_m[own, 2], r.speed_ms[own, 2]
    final = float(np.median(r.place_m[r.within("hover", 5.0), 2]))
    return {
        "climb: fastest, m/s": f"{speed.max():.2f}",
        "climb: overshoot, m": f"{up.max() - final:.2f}",
    }


def _hover(r: Record) -> dict[str, str]:
    own = r.within("hover", 20.0)
    place, angles, rates = r.place_m[own], r.angles_deg[own], r.rates_deg_s[own]
    flat = np.linalg.norm(place[:, :2] - place[:, :2].mean(axis=0), axis=1)
    lean = np.hypot(angles[:, 0], angles[:, 1])
    wobble = np.hypot(*(angles[:, k] - angles[:, k].mean() for k in (0, 1)))
    ground = r.within("climb", 0.0).start
    off = r.estimate_m[own] - place - (r.estimate_m[ground] - r.place_m[ground])
    return {
        "hover: mean lean, deg": f"{lean.mean():.2f}",
        "hover: roll and pitch about their means, rms deg": f"{_rms(wobble):.3f}",
        "hover: roll and pitch rates, rms deg/s": f"{_rms(np.hypot(rates[:, 0], rates[:, 1])):.2f}",
        "hover: yaw rate, rms deg/s": f"{rates[:, 2].std():.2f}",
        "hover: level speed, rms m/s": f"{_rms(np.hypot(*r.speed_ms[own, :2].T)):.3f}",
        "hover: vertical speed, rms m/s": f"{_rms(r.speed_ms[own, 2]):.3f}",
        "hover: place about its mean, rms m": f"{_rms(flat):.3f}",
        "hover: height about its mean, rms m": f"{place[:, 2].std():.3f}",
        "estimate less truth, since take-off: level, m": f"{np.hypot(*off[:, :2].mean(axis=0)):.2f}",
        "estimate less truth, since take-off: up, m": f"{off[:, 2].mean():.2f}",
    }


def _steps(r: Record) -> dict[str, str]:
    told = {}
    own = r.within("north", 14.0)
    way = r.place_m[own, 0] - r.place_m[own.start, 0]
    told |= _step("10 m: ", r.time_s[own] - r.time_s[own.start], way, STEP_M, SETTLED_M, "m")
    told["10 m: fastest, m/s"] = f"{r.speed_ms[own, 0].max():.2f}"
    told |= _lean("10 m: ", r, own)
    own = r.within("faster", 7.0)
    told |= _step(
        "3 m/s: ", r.time_s[own] - r.time_s[own.start], r.speed_ms[own, 0], SPEED_MS, SETTLED_MS, "m/s"
    )
    told |= _lean("3 m/s: ", r, own)
    own = r.within("stop", 7.0)
    slower = SPEED_MS - r.speed_ms[own, 0]
    told |= _step("stop: ", r.time_s[own] - r.time_s[own.start], slower, SPEED_MS, SETTLED_MS, "m/s")
    told |= _lean("stop: ", r, own)
    return told


def _step(name: str, time_s: F64, value: F64, goal: float, settled: float, unit: str) -> dict[str, str]:
    """Return delay to 10 %, rise from 10 to 90 %, overshoot and the time to settle."""

    def first(level: float) -> float:
        found = np.flatnonzero(value >= level * goal)
        return float(time_s[found[0]]) if found.size else math.nan

    outside = np.flatnonzero(np.abs(value - goal) > settled)
    end = float(time_s[outside[-1]]) if outside.size else 0.0
    return {
        f"{name}to 10 %, s": f"{first(0.1):.2f}",
        f"{name}10 to 90 %, s": f"{first(0.9) - first(0.1):.2f}",
        f"{name}overshoot, {unit}": f"{max(0.0, float(value.max()) - goal):.2f}",
        f"{name}within {settled:g} {unit} after, s": f"{end:.1f}",
    }


def _lean(name: str, r: Record, own: slice) -> dict[str, str]:
    before = r.angles_deg[max(own.start - 25, 0) : own.start, :2].mean(axis=0)
    lean = np.hypot(*(r.angles_deg[own, :2] - before).T)
    rates = np.hypot(*r.rates_deg_s[own, :2].T)
    return {
        f"{name}lean, most, deg": f"{lean.max():.1f}",
        f"{name}roll and pitch rate, most, deg/s": f"{rates.max():.0f}",
    }


def _turn(r: Record) -> dict[str, str]:
    own = r.within("turn", 10.0)
    yaw = np.degrees(np.unwrap(np.radians(r.angles_deg[own, 2])))
    turned, rate = np.abs(yaw - yaw[0]), np.abs(r.rates_deg_s[own, 2])
    time_s = r.time_s[own] - r.time_s[own.start]
    return _step("turn: ", time_s, turned, float(turned[-1]), 2.0, "deg") | {
        "turn: fastest, deg/s": f"{rate.max():.0f}"
    }


def _landing(r: Record) -> dict[str, str]:
    begin, end = r.marks["land"], r.marks["disarmed"]
    own = slice(*(int(k) for k in np.searchsorted(r.time_s, (begin, end + 1.5))))
    up, speed, time_s = r.place_m[own, 2], r.speed_ms[own, 2], r.time_s[own]
    ground = float(np.median(up[-25:]))
    above = up - ground
    touch = int(np.flatnonzero(above > 0.02)[-1])
    before = slice(max(0, touch - 15), touch + 1)
    low = (above < 5.0) & (above > 0.5)
    flat = r.place_m[own, :2]
    lean = np.hypot(r.angles_deg[own, 0], r.angles_deg[own, 1])
    return {
        "LAND: fastest, m/s": f"{-speed.min():.2f}",
        "LAND: below 5 m, m/s": f"{-float(np.median(speed[low])):.2f}",
        "touchdown: vertical speed, m/s": f"{-float(speed[before].min()):.2f}",
        "touchdown: level speed, m/s": f"{float(np.hypot(*r.speed_ms[own, :2][touch])):.3f}",
        "touchdown: lean, deg": f"{lean[touch]:.2f}",
        "LAND: drift from its start, m": f"{float(np.hypot(*(flat[touch] - flat[0]))):.2f}",
        "touchdown to disarmed, s": f"{end - float(time_s[touch]):.1f}",
        "LAND to touchdown, s": f"{float(time_s[touch]) - begin:.1f}",
    }


def _rms(values: F64) -> float:
    return float(np.sqrt(np.mean(np.square(values))))
