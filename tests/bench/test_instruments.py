"""Budgets of the flash LiDAR and the radar: processor time on one core."""

from __future__ import annotations

import time
from collections.abc import Callable

import numpy as np
import pytest

from slz.flash.camera import FlashCamera, FlashFrame
from slz.flash.frame_processing import process_frame, sensor_points
from slz.radar.dem import fuse, observe
from slz.radar.interferometer import Interferometer
from tests.unit.slz.flash.pit import Pit
from tests.unit.slz.radar.site import GRID, Site

pytestmark = pytest.mark.bench
FRAME_MS, SITE_S = 20.0, 2.0


def median_s(work: Callable[[], object], times: int) -> float:
    """Return the median processor time of a computation in this thread."""
    taken = []
    for _ in range(times):
        started = time.thread_time()
        work()
        taken.append(time.thread_time() - started)
    return float(np.median(taken))


@pytest.mark.parametrize("estimator", ["likely", "polynomial"])
def test_a_flash_frame_of_128_by_128_takes_at_most_20_ms(estimator: str) -> None:
    raw, _, _ = Pit(1).look(0.0, 0.0)
    frame, camera = FlashFrame(raw.samples, raw.counter), FlashCamera()
    ms = 1e3 * median_s(lambda: sensor_points(process_frame(frame, camera, estimator), camera), 40)  # type: ignore[arg-type]
    print(f"\n{estimator}: {ms:.1f} ms from waveforms to points")
    assert ms <= FRAME_MS


def test_the_landing_site_of_100_m_at_half_a_metre_takes_at_most_2_s() -> None:
    site, radar = Site(1), Interferometer()
    seconds = median_s(lambda: fuse([observe(lines, radar, GRID) for lines in site.lines]), 5)
    print(f"\nfour observations and fusing: {seconds:.2f} s")
    assert seconds <= SITE_S
