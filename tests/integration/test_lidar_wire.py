"""Simulated sensors to driver: no return is lost except in the steps of the packet format."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from companion.flight.sensors.sensor_registry import decoder_for
from sitl.sensors.mid360 import Mid360
from sitl.sensors.optics import Noise
from sitl.sensors.ouster_os1 import Ouster
from sitl.sensors.pulse_lidar import PulseLidar, Shots
from sitl.sensors.sensor_clock import Clock
from sitl.sensors.velodyne_packets import ReturnMode
from sitl.sensors.vlp16 import Vlp16
from tests.unit.companion.flight.sensors.ouster_packets import MISSING
from tests.unit.sitl.still_world import flat_world, hover

F64 = NDArray[np.float64]
MS = 1_000_000
CLOCK = Clock(offset_ns=4_000_000_000, drift_ppb=0)
SPAN_NS = 120 * MS  # over a whole turn
needs_ouster = pytest.mark.skipif(bool(MISSING), reason=MISSING)


def polar(points: F64, up_m: F64) -> tuple[F64, F64]:
    """Return distance from a laser's own origin, and azimuth in degrees."""
    x, y, z = points.T
    return np.sqrt(x**2 + y**2 + (z - up_m) ** 2), np.degrees(np.arctan2(y, x))


def fired(make: type[PulseLidar], **options: object) -> tuple[PulseLidar, list[bytes], Shots]:
    """Return a sensor, its packets, and the shots that are in them, of two sensors with the same luck."""
    both = [make(np.random.default_rng(1), clock=CLOCK, **options) for _ in range(2)]  # type: ignore[call-arg]
    packets = both[0].scan(0, SPAN_NS, hover(), flat_world())
    shots = both[1].shots(0, SPAN_NS, hover(), flat_world())[slice(len(packets) * both[0].pulses_per_packet)]
    return both[1], packets, shots


def test_livox_to_half_a_millimetre() -> None:
    sensor, packets, shots = fired(Mid360, noise=Noise(dust=0.0, ghost=0.0))
    raw = decoder_for("livox").decode(packets)  # type: ignore[attr-defined]
    hit = shots.echoes.range_m > 0
    np.testing.assert_allclose(raw.xyz_m, sensor.points_m(shots)[hit], atol=0.00051)
    np.testing.assert_allclose(raw.stamp_ns, CLOCK.offset_ns + sensor.stamps_ns(shots)[hit], atol=1)
    np.testing.assert_array_equal(raw.ring, shots.index[hit] % 4)


def test_velodyne_to_a_millimetre_and_a_hundredth_of_a_degree() -> None:
    sensor, packets, shots = fired(Vlp16, noise=Noise(dust=0.0, ghost=0.0))
    decoder = decoder_for("velodyne")
    raw = decoder.decode(packets)  # type: ignore[attr-defined]
    hit = shots.echoes.range_m > 0
    up_m = sensor.origins_m(shots.index[hit])[:, 2]  # type: ignore[index]
    distance, azimuth = polar(raw.xyz_m.astype(float), up_m)
    true_distance, true_azimuth = polar(sensor.points_m(shots)[hit], up_m)
    np.testing.assert_allclose(distance, true_distance, atol=0.00102)
    assert np.abs((azimuth - true_azimuth + 180) % 360 - 180).max() < 0.0151
    assert np.abs((azimuth - true_azimuth + 180) % 360 - 180).mean() < 0.006
    # Stamps are sent in whole microseconds of each packet's first firing.
    late_ns = CLOCK.offset_ns + sensor.stamps_ns(shots)[hit] - raw.stamp_ns % 3_600_000_000_000
    assert late_ns.min() >= 0
    assert late_ns.max() < 1000
    assert decoder.counters.lost_packets == decoder.counters.malformed == 0


def test_velodyne_in_dual_mode_tells_dust_from_what_lies_behind() -> None:
    noise = Noise(0.0, 0.0, 0.0, ghost=0.0, dust=0.05)
    _, packets, shots = fired(Vlp16, noise=noise, mode=ReturnMode.DUAL)
    raw = decoder_for("velodyne").decode(packets)  # type: ignore[attr-defined]
    e = shots.echoes
    both = e.dust & (e.behind_m > 0)
    assert len(raw) == np.count_nonzero(e.range_m) + np.count_nonzero(both)
    assert np.count_nonzero(raw.echo == 2) == np.count_nonzero(both) > 100
    near = np.sort(np.linalg.norm(raw.xyz_m[(raw.echo == 1) & (raw.echoes == 2)], axis=1))
    np.testing.assert_allclose(near, np.sort(e.range_m[both]), atol=0.013)


@needs_ouster
def test_ouster_to_half_a_millimetre() -> None:
    sensor, packets, shots = fired(Ouster, noise=Noise(dust=0.0, ghost=0.0))
    assert isinstance(sensor, Ouster)
    decoder = decoder_for("ouster", sensor.metadata)
    raw = decoder.decode(packets)  # type: ignore[attr-defined]
    hit = shots.echoes.range_m > 0
    points = sensor.points_m(shots)[hit]
    apart = raw.xyz_m - points
    along = np.linalg.norm(points, axis=1)
    assert np.abs(np.einsum("ij,ij->i", apart, points) / along).max() < 0.00052
    assert np.linalg.norm(apart, axis=1).max() < 0.00052
    np.testing.assert_array_equal(raw.stamp_ns, CLOCK.offset_ns + sensor.stamps_ns(shots)[hit])
    np.testing.assert_array_equal(raw.ring, 31 - shots.index[hit] % 32)
    assert decoder.counters.lost_packets == decoder.counters.malformed == 0
