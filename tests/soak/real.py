"""Hours of real time at full rate: the feeder's Mid-360, a browser on the page, recordings of ten minutes."""

from __future__ import annotations

import asyncio
import shutil
import time
from pathlib import Path

import params
from companion.flight.app import Companion
from companion.flight.dashboard.page import PageEndpoint
from companion.flight.sensing import Sources
from companion.flight.telling import Displays
from companion.runtime.state_directory import StateDir
from tests.bench.test_page import browsers
from tests.bench.test_streams import POINTS_PER_S, feeder
from tests.ports import free_port
from tests.soak.gauges import Gauges

LOOK_S, RECORDED_S = 30.0, 600.0


async def run(hours: float, path: Path) -> Gauges:
    """Run the companion for so long; a recording begins as the last one ends, and the last one is deleted."""
    folder = path.parent / "state"
    gauges, front = Gauges(path), PageEndpoint("127.0.0.1:0")
    mavlink_port, lidar_port = free_port(), free_port()
    with feeder(mavlink_port, lidar_port, POINTS_PER_S):
        companion = Companion(
            f"udpin:127.0.0.1:{mavlink_port}",
            Sources(f"livox:127.0.0.1:{lidar_port}"),
            params.Parameters(),
            auto=True,
            state=StateDir(folder),
            displays=Displays(front),
        )
        task = asyncio.create_task(companion.run())
        while not (companion.link.ready and companion.mapping.worker.reports):
            await asyncio.sleep(0.1)
        with browsers(str(front.address)):
            await _watch(companion, gauges, hours, folder)
        companion.stop()
        await task
    gauges.close()
    shutil.rmtree(folder, ignore_errors=True)
    return gauges


async def _watch(companion: Companion, gauges: Gauges, hours: float, folder: Path) -> None:
    end_s, next_recording_s = time.monotonic() + hours * 3600, 0.0
    while (now_s := time.monotonic()) < end_s:
        if now_s >= next_recording_s:
            next_recording_s = now_s + RECORDED_S
            await _record_anew(companion, folder)
        await asyncio.sleep(LOOK_S)
        gauges.read(companion, time.monotonic())


async def _record_anew(companion: Companion, folder: Path) -> None:
    if companion.telling.recordings.recorder is not None:
        await companion.telling.recordings.set_recording(on=False)
        for old in (folder / "recordings").iterdir():
            old.unlink()
    said = await companion.telling.recordings.set_recording(on=True)
    assert said.accepted, said.reason
