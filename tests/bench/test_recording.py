"""Benchmark of recording at full rate, which must cost no scan.

`SLZ_RECORD_S=600 pytest -m bench -s tests/bench/test_recording.py` for ten minutes.
"""

from __future__ import annotations

import asyncio
import json
import os
from pathlib import Path
from typing import Any

import pytest

import params
from companion.desk.replay import replay_run as replay
from companion.flight.app import Companion
from companion.flight.sensing import Sources
from tests.bench.test_streams import feeder
from tests.ports import free_port

POINTS_PER_S = 312_500
RECORDED_S = float(os.environ.get("SLZ_RECORD_S", "60"))


async def record(mavlink_port: int, lidar_port: int, path: Path) -> dict[str, Any]:
    """Run the companion with a recording for so long after its first report; return its summary."""
    companion = Companion(
        f"udpin:127.0.0.1:{mavlink_port}",
        Sources(f"livox:127.0.0.1:{lidar_port}"),
        params.Parameters(),
        auto=False,
        record=path,
    )
    task = asyncio.create_task(companion.run())
    while not (companion.link.ready and companion.mapping.worker.reports):
        await asyncio.sleep(0.1)
    stale = companion.sensing.assembler.stale  # of what came before any pose
    await asyncio.sleep(RECORDED_S)
    companion.stop()
    await task
    companion.summary["fusion"]["stale"] -= stale
    return companion.summary


@pytest.mark.bench
@pytest.mark.timeout(RECORDED_S * 3 + 300)
def test_a_recording_at_full_rate_costs_no_scan_and_is_replayed_to_the_last_bit(tmp_path: Path) -> None:
    mavlink_port, lidar_port = free_port(), free_port()
    path = tmp_path / "flight.mcap"
    with feeder(mavlink_port, lidar_port, POINTS_PER_S):
        told = asyncio.run(record(mavlink_port, lidar_port, path))
    again = replay.run(path, [], None, 0.0, (0.0, 1e9))
    figures = {
        "seconds": RECORDED_S,
        "returns_per_s": told["lidar"]["rate_hz"],
        "lost_packets": told["lidar"]["lost_packets"],
        "stale": told["fusion"]["stale"],
        "dropped_windows": told["dropped_windows"],
        "recording": told["recording"],
        "latency_ms": told["latency_ms"],
        "identical": again["identical"],
        "different": again["different"],
        "load": os.getloadavg()[0],
    }
    print(json.dumps(figures))
    assert (told["lidar"]["lost_packets"], told["fusion"]["stale"], told["dropped_windows"]) == (0, 0, 0)
    assert not told["recording"]["dropped"]
    assert again["different"] == 0
    assert again["identical"] == told["reports"]
