"""Poses between ticks against NumPy's interpolation."""

from __future__ import annotations

import numpy as np

from sitl.vehicle.pose_track import PoseTrack


def test_poses_between_ticks_are_interpolated_and_kept_beyond_the_ends() -> None:
    rng, track = np.random.default_rng(3), PoseTrack()
    stamps = 5_000_000_000 + np.cumsum(rng.integers(1, 4_000_000, 6))
    quats = rng.normal(1.0, 0.1, (6, 4))
    quats /= np.linalg.norm(quats, axis=1)[:, np.newaxis]
    positions = rng.normal(0.0, 9.0, (6, 3))
    for k, stamp in enumerate(stamps.tolist()):
        track.add(stamp, positions[k], quats[k] if k % 2 else -quats[k])  # the same attitude
    when = np.sort(np.concatenate([stamps, rng.integers(stamps[0] - 99, stamps[-1] + 99, 300)]))
    position, quat = track.at(when)
    for found, given in ((position, positions), (quat, -quats)):
        lines = np.column_stack([np.interp(when, stamps, given[:, i]) for i in range(given.shape[1])])
        if found is quat:
            lines /= np.linalg.norm(lines, axis=1)[:, np.newaxis]
        np.testing.assert_allclose(found, lines, rtol=0, atol=1e-12)
