"""Survey benchmark: surveys of any size, and measurements of `slz map` on them (docs/benchmark/surveys.md).

python -m tests.bench.surveys make --points 1e7 --out /tmp/cloud
python -m tests.bench.surveys decode /tmp/cloud
python -m tests.bench.surveys measure /tmp/cloud --out /tmp/maps [--workers 2] [--repeat 3]
"""

from __future__ import annotations

import argparse
import json
import os
import resource
import shutil
import struct
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import laspy
import numpy as np
from pyproj import CRS

from companion.desk import survey
from companion.desk.clouds.las import LAYERS
from params import load

FILE_POINTS = 5_000_000
DISTINCT = 4  # files of other ground; the rest are these elsewhere
CORNER = np.array([500_000.0, 4_500_000.0])
LINES_M, STEP_M = 0.5, 0.25  # between scan lines, and along one: 8 points/m2
GROUND_M = 60.0  # grid of the things on the ground


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    steps = parser.add_subparsers(dest="step", required=True)
    making = steps.add_parser("make")
    making.add_argument("--points", type=float, required=True)
    making.add_argument("--out", type=Path, required=True)
    making.add_argument("--density", type=float, default=8.0)
    making.add_argument("--format", type=int, default=6)
    decoding = steps.add_parser("decode")
    decoding.add_argument("folder", type=Path)
    measuring = steps.add_parser("measure")
    measuring.add_argument("folder", type=Path)
    measuring.add_argument("--out", type=Path, required=True)
    measuring.add_argument("--workers", type=int)
    measuring.add_argument("--repeat", type=int, default=1)
    measuring.add_argument("--cell-m", type=float, default=0.5)
    asked = parser.parse_args()
    if asked.step == "make":
        make(round(asked.points), asked.out, asked.density, asked.format)
    elif asked.step == "decode":
        print(json.dumps(decode(asked.folder)))
    else:
        for _ in range(asked.repeat):
            print(json.dumps(measure(asked.folder, asked.out, asked.workers, asked.cell_m)), flush=True)


def make(n_points: int, folder: Path, density: float, form: int) -> None:
    """Write LAZ files side by side, each a square of scan lines over rolling ground with houses and trees."""
    folder.mkdir(parents=True, exist_ok=True)
    count = max(1, round(n_points / FILE_POINTS))
    each = n_points // count
    side_m = (each / density) ** 0.5
    across = int(np.ceil(count**0.5))
    for k in range(count):
        path = folder / f"{k:05d}.laz"
        place = side_m * np.array([k % across, k // across])
        if k < DISTINCT:
            _write(path, _scanned(CORNER, side_m, each, k), form)
            _move(path, path, place)
        else:
            before = side_m * np.array([k % DISTINCT % across, k % DISTINCT // across])
            _move(folder / f"{k % DISTINCT:05d}.laz", path, place - before)


def _move(source: Path, path: Path, by_m: np.ndarray) -> None:
    """Copy a file of points to another place: only its header tells where they lie."""
    data = bytearray(source.read_bytes())
    for axis in (0, 1):  # LAS 1.4 R15, table 3: offsets, then the greatest and least coordinates
        for at in (155 + 8 * axis, 179 + 16 * axis, 187 + 16 * axis):
            (value,) = struct.unpack_from("<d", data, at)
            struct.pack_into("<d", data, at, value + float(by_m[axis]))
    path.write_bytes(data)


def _scanned(corner: np.ndarray, side_m: float, n: int, seed: int) -> np.ndarray:
    rng = np.random.default_rng(seed)
    lines = round((n * LINES_M / STEP_M) ** 0.5 * (STEP_M / LINES_M))
    along = n // lines + 1
    number = np.arange(n)
    line, at = number // along, number % along / along
    u = np.where(line % 2 == 0, at, 1 - at) * side_m + rng.normal(0, 0.03, n)
    v = (line + rng.uniform(0, 0.6, n)) / lines * side_m
    x, y = corner[0] + np.clip(u, 0, side_m), corner[1] + np.clip(v, 0, side_m)
    z = 200 + 8 * np.sin(x / 310) + 6 * np.cos(y / 240) + rng.normal(0, 0.02, n)
    col, row = np.floor(x / GROUND_M).astype(np.int64), np.floor(y / GROUND_M).astype(np.int64)
    kind = (col * 73_856_093 ^ row * 19_349_663) % 7
    dx, dy = x / GROUND_M - col - 0.5, y / GROUND_M - row - 0.5
    z[(kind == 0) & (np.abs(dx) < 0.15) & (np.abs(dy) < 0.1)] += 6.0  # a house
    tree = (kind == 1) & (np.hypot(dx, dy) < 0.12)
    z[tree] += rng.uniform(0, 9, int(tree.sum()))
    return np.column_stack([x, y, z])


def _write(path: Path, xyz: np.ndarray, form: int) -> None:
    header = laspy.LasHeader(point_format=form, version="1.4" if form >= 6 else "1.2")
    header.scales, header.offsets = np.full(3, 0.01), np.array([*CORNER, 0.0])
    header.add_crs(CRS("EPSG:32610"))
    las = laspy.LasData(header)
    las.x, las.y, las.z = xyz.T
    las.classification = np.full(len(xyz), 2, np.uint8)
    las.return_number = las.number_of_returns = np.ones(len(xyz), np.uint8)
    las.intensity = np.random.default_rng(9).normal(900, 60, len(xyz)).astype(np.uint16)
    if form:
        las.gps_time = np.arange(len(xyz)) * 2e-6 + 3e8
    las.write(path)


def decode(folder: Path) -> dict[str, Any]:
    """Time the decompression of LAZ alone, one core: all layers, and those that a map needs."""
    told: dict[str, Any] = {"load": os.getloadavg()}
    for name, layers in (("all", laspy.DecompressionSelection.all()), ("needed", LAYERS)):
        wall, cpu, n = time.perf_counter(), time.thread_time(), 0
        for path in sorted(folder.glob("*.laz"))[:2]:
            with laspy.open(
                path, laz_backend=[laspy.LazBackend.Lazrs], decompression_selection=layers
            ) as reader:
                n += sum(len(piece) for piece in reader.chunk_iterator(1_000_000))
        told[name] = {
            "m_points_per_s": round(n / (time.perf_counter() - wall) / 1e6, 2),
            "m_points_per_cpu_s": round(n / (time.thread_time() - cpu) / 1e6, 2),
        }
    return told


def measure(folder: Path, out: Path, workers: int | None, cell_m: float) -> dict[str, Any]:
    """Map a folder and return wall and CPU time, points a second and the most memory of a worker."""
    shutil.rmtree(out, ignore_errors=True)
    parameters = load("quadcopter", [f"cell_m={cell_m}"])
    files = sorted(folder.glob("*.laz"))
    with survey.engine(None, workers) as engine:
        pids = engine.process_ids() if workers else [os.getpid()]
        with _watched(pids) as memory:
            wall, cpu = time.perf_counter(), _cpu_s(pids) + time.process_time() * bool(workers)
            told = survey.run(files, out, parameters, lambda *_: None, survey.MapOptions(engine=engine))
            wall = time.perf_counter() - wall
            cpu = _cpu_s(pids) + time.process_time() * bool(workers) - cpu
    n = told["points"]["read"]
    return {
        "workers": workers,
        "points": n,
        "wall_s": round(wall, 2),
        "cpu_s": round(cpu, 2),
        "m_points_per_s": round(n / wall / 1e6, 3),
        "m_points_per_cpu_s": round(n / cpu / 1e6, 3),
        "worker_mib": round(max(memory)),
        "driver_mib": round(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024),
        "stage_ms": told["stage_ms"],
        "zones": len(told["zones"]),
        "load": os.getloadavg(),
    }


def _cpu_s(pids: list[int]) -> float:
    ticks = os.sysconf("SC_CLK_TCK")
    total = 0
    for pid in pids:
        fields = Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()
        total += int(fields[11]) + int(fields[12])
    return total / ticks


@contextmanager
def _watched(pids: list[int]) -> Iterator[list[float]]:
    """Note how much memory of its own (anonymous pages, MiB) each process takes, ten times a second."""
    found, ended = [0.0] * len(pids), threading.Event()

    def look() -> None:
        while not ended.wait(0.1):
            for k, pid in enumerate(pids):
                status = Path(f"/proc/{pid}/status").read_text()
                kib = next(int(line.split()[1]) for line in status.splitlines() if line.startswith("RssAnon"))
                found[k] = max(found[k], kib / 1024)

    watcher = threading.Thread(target=look)
    watcher.start()
    try:
        yield found
    finally:
        ended.set()
        watcher.join()


if __name__ == "__main__":
    main()
