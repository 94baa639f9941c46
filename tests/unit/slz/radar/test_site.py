"""Whole radar chain: four flights around the landing site, fused, through the ordinary SLZ stages."""

from __future__ import annotations

import time

import numpy as np
import pytest

from sitl.world.primitives import Kind
from slz.radar.dem import fuse, observe
from slz.radar.interferometer import Interferometer
from tests.unit.slz.radar.site import GRID, Site, judge


@pytest.mark.bench
@pytest.mark.parametrize("seed", [1, 2, 3])
def test_four_observations_of_the_site_are_accurate_and_hide_no_danger(seed: int) -> None:
    site = Site(seed)
    radar = Interferometer()
    started = time.perf_counter()
    single = [observe(lines, radar, GRID) for lines in site.lines]
    fused = fuse(single)
    elapsed_s = time.perf_counter() - started
    even = site.even()
    errors = []
    for dem in (*single, fused):
        error = (dem.height_m - site.height_m)[even]
        errors.append(float(np.sqrt(np.nanmean(error**2))))
    verdict = judge(site, fused)
    print(f"\nseed {seed}: rms {np.round(errors, 4)} m, {elapsed_s:.2f} s, {verdict}")
    assert max(errors[:4]) <= 0.082
    assert errors[4] <= 0.05
    assert np.isnan(fused.height_m[site.kind == Kind.WATER]).mean() > 0.99
    assert verdict.objects_missed <= 0.05 * verdict.objects
    assert verdict.steep_missed == 0
    assert verdict.recall > 0.4
