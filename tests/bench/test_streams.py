"""Real-time rates of the output streams with the pipeline at work: `pytest -m bench -s tests/bench`.

Other load on the computer affects them. `chrt -r 10` before the command keeps other programs off, as the
service on a vehicle does.
"""

from __future__ import annotations

import asyncio
import json
import os
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np
import pytest

import params
from companion.flight.app import Companion
from companion.flight.sensing import Sources
from tests.ports import free_port

POINTS_PER_S = 200_000
SETTLE_S, MEASURED_S = 8.0, 20.0


@contextmanager
def feeder(mavlink_port: int, lidar_port: int, points_per_s: int) -> Iterator[subprocess.Popen[str]]:
    command = [
        sys.executable,
        "-m",
        "tests.bench.feeder",
        *map(str, (mavlink_port, lidar_port, points_per_s)),
    ]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        assert process.stdin is not None
        try:
            assert process.stdout.readline() == "ready\n"
            yield process
        finally:
            process.stdin.close()
            process.wait(30)


async def measure(mavlink_port: int, lidar_port: int) -> dict[str, Any]:
    """Run the companion with a target to stream; return its summary and what the clock said meanwhile."""
    companion = Companion(
        f"udpin:127.0.0.1:{mavlink_port}",
        Sources(f"livox:127.0.0.1:{lidar_port}"),
        params.Parameters(),
        auto=False,
    )
    task = asyncio.create_task(companion.run())
    while not (companion.link.ready and companion.mapping.worker.reports):
        await asyncio.sleep(0.1)
    await asyncio.sleep(SETTLE_S)
    companion.deciding.loop.run_once = lambda: None  # type: ignore[method-assign]  # the executive would take the target away
    companion.deciding.execution.target_enu_m = np.array([1.0, 2.0, -12.0])
    residuals, before = [], companion.sensing.lidar.statistics()["returns"]
    start = time.monotonic()
    for _ in range(int(MEASURED_S)):
        await asyncio.sleep(1)
        residuals.append(companion.link.inbox.clock.timesync.residual_ns * 1e-6)
    seconds = time.monotonic() - start
    returns = float(companion.sensing.lidar.statistics()["returns"] or 0) - float(before or 0)
    companion.stop()
    await task
    return {
        **companion.summary["streams"]["LANDING_TARGET"],
        "sync_residual_p99_ms": round(float(np.percentile(residuals, 99)), 2),
        "returns_per_s": round(returns / seconds),
        "latency_ms": companion.summary["latency_ms"],
        "dropped_windows": companion.mapping.worker.dropped_windows,
        "load": os.getloadavg()[0],
    }


@pytest.mark.bench
def test_the_landing_target_is_steady_and_fresh_while_the_pipeline_works() -> None:
    mavlink_port, lidar_port = free_port(), free_port()
    with feeder(mavlink_port, lidar_port, POINTS_PER_S) as process:
        told = asyncio.run(measure(mavlink_port, lidar_port))
        assert process.stdin is not None
        assert process.stdout is not None
        process.stdin.close()
        arrivals_ms = np.array(json.loads(process.stdout.read())) * 1e-6
    jitter_ms = np.abs(np.diff(arrivals_ms) - 50.0)
    told["arrival_jitter_p99_ms"] = round(float(np.percentile(jitter_ms, 99)), 2)
    print(json.dumps(told))
    assert told["hz"] == pytest.approx(20, abs=1)
    assert told["jitter_ms"]["p99"] <= 10
    assert told["pose_age_ms"]["p99"] <= 40
    assert told["sync_residual_p99_ms"] <= 3
    assert told["dropped_windows"] == 0
