"""Packets of three simulated sensors with faults of their stream: still sound, and changed as named."""

from __future__ import annotations

import zlib
from functools import cache

import numpy as np
import pytest

from sitl.faults import packet_edit, stream_faults
from sitl.sensors.livox_packets import CARTESIAN_32, HEADER, HEADER_BYTES
from sitl.sensors.mid360 import Mid360
from sitl.sensors.ouster_os1 import Ouster
from sitl.sensors.ouster_packets import packet_type
from sitl.sensors.velodyne_packets import PACKET
from sitl.sensors.vlp16 import Vlp16
from tests.unit.sitl.still_world import flat_world, hover

ALL = ("mid360", "vlp16", "os1")
MAKERS = {"mid360": "livox", "vlp16": "velodyne", "os1": "ouster"}


@cache
def packets(sensor: str) -> list[bytes]:
    make = {"mid360": Mid360, "vlp16": Vlp16, "os1": Ouster}[sensor]
    return list(make(np.random.default_rng(3)).scan(0, 100_000_000, hover(), flat_world()))


def rng(seed: int = 11) -> np.random.Generator:
    return np.random.default_rng(seed)


def rays(sensor: str, packet: bytes) -> tuple[np.ndarray, np.ndarray]:
    """Return azimuths (deg, NaN without a return) and ranges (m) of a packet's rays."""
    match sensor:
        case "mid360":
            assert HEADER.unpack_from(packet)[-1] == zlib.crc32(packet[HEADER.size :])
            xyz = np.frombuffer(packet[HEADER_BYTES:], CARTESIAN_32)["xyz"] / 1000.0
            range_m = np.linalg.norm(xyz, axis=1)
            azimuth = np.degrees(np.arctan2(xyz[:, 1], xyz[:, 0])) % 360
            return np.where(range_m > 0, azimuth, np.nan), range_m
        case "vlp16":
            blocks = np.frombuffer(packet, PACKET)["blocks"][0]
            range_m = blocks["channels"]["distance"] * 0.002
            return np.repeat(
                -blocks["azimuth"].astype(float) / 100.0 % 360, range_m.shape[1]
            ), range_m.ravel()
    one = columns(packet)
    range_m = np.where(one["status"][:, np.newaxis] & 1, one["pixels"]["range"] & 0x7FFFF, 0) / 1000.0
    azimuth = (180 - one["measurement_id"].astype(float) * 360 / packet_edit.COLUMNS) % 360
    return np.repeat(azimuth, range_m.shape[1]), range_m.ravel()


def columns(packet: bytes) -> np.ndarray:
    rows = (len(packet) - packet_type(0).itemsize) // (packet_type(1).itemsize - packet_type(0).itemsize)
    return np.frombuffer(packet, packet_type(rows))["columns"][0]


def inside(azimuth: np.ndarray, from_deg: float, width_deg: float) -> np.ndarray:
    return (azimuth - from_deg) % 360 < width_deg


@pytest.mark.parametrize("sensor", ALL)
def test_the_maker_is_known_by_the_packet(sensor: str) -> None:
    assert {packet_edit.maker_of(packet) for packet in packets(sensor)} == {MAKERS[sensor]}


def test_of_the_packets_a_share_is_lost() -> None:
    kept = stream_faults.Loss(rng(), 0.25)(packets("mid360") * 10)
    assert len(kept) / len(packets("mid360") * 10) == pytest.approx(0.75, abs=0.03)


@pytest.mark.parametrize("sensor", ALL)
def test_behind_a_cover_no_ray_returns_and_beside_it_all_do(sensor: str) -> None:
    got = stream_faults.Cover(rng(), 10.0, 60.0)(packets(sensor))
    assert len(got) == len(packets(sensor))
    hidden = 0
    for before, after in zip(packets(sensor), got, strict=True):
        (azimuth, was_m), (_, is_m) = rays(sensor, before), rays(sensor, after)
        covered = inside(azimuth, 10.0, 60.0) & (was_m > 0)
        hidden += np.count_nonzero(covered)
        assert (is_m[covered] == 0).all()
        assert (is_m[~covered] == was_m[~covered]).all()
    assert hidden > 100


@pytest.mark.parametrize("sensor", ALL)
def test_a_sector_that_is_not_measured_has_neither_rays_nor_whole_packets(sensor: str) -> None:
    got = stream_faults.Sector(rng(), 10.0, 60.0)(packets(sensor))
    assert (len(got) < len(packets(sensor))) == (sensor == "vlp16")
    for packet in got:
        azimuth, range_m = rays(sensor, packet)
        within = inside(azimuth, 15.0, 50.0)  # a packet of a turning sensor may begin beside it
        assert not (range_m[within] > 0).any()


@pytest.mark.parametrize("sensor", ALL)
def test_a_dirty_window_returns_from_itself_or_not_at_all(sensor: str) -> None:
    got = stream_faults.Dirt(rng(), -30.0, 60.0)(packets(sensor))
    near = gone = rest = 0
    for before, after in zip(packets(sensor), got, strict=True):
        (azimuth, was_m), (_, is_m) = rays(sensor, before), rays(sensor, after)
        soiled = inside(azimuth, -30.0, 60.0) & (was_m > 0)
        assert (is_m[~soiled & (was_m > 0)] == was_m[~soiled & (was_m > 0)]).all()
        near += np.count_nonzero((is_m[soiled] > 0.1) & (is_m[soiled] < 0.3))
        gone += np.count_nonzero(is_m[soiled] == 0)
        rest += np.count_nonzero(is_m[soiled] == was_m[soiled])
    whole = near + gone + rest
    assert near / whole == pytest.approx(0.4 if sensor != "mid360" else 0.12, abs=0.04)
    assert rest / whole == pytest.approx(0.18, abs=0.04)


def test_a_dead_row_is_one_line_of_four() -> None:
    for packet, after in zip(packets("mid360"), stream_faults.DeadRow(2)(packets("mid360")), strict=True):
        was_m, is_m = rays("mid360", packet)[1], rays("mid360", after)[1]
        assert not is_m[2::4].any()
        assert (np.delete(is_m, np.s_[2::4]) == np.delete(was_m, np.s_[2::4])).all()


@pytest.mark.parametrize("sensor", ["mid360", "os1"])
def test_at_half_rate_numbers_have_no_gap(sensor: str) -> None:
    got = stream_faults.HalfRate()(packets(sensor))
    numbers = [packet_edit.number_of(packet) for packet in got]
    assert len(got) == (len(packets(sensor)) + 1) // 2
    assert numbers == list(range(numbers[0], numbers[0] + len(got)))


def stamp_ns(sensor: str, packet: bytes) -> int:
    match sensor:
        case "mid360":
            return int.from_bytes(packet[HEADER.size : HEADER_BYTES], "little")
        case "vlp16":
            return int(np.frombuffer(packet, PACKET)["stamp"][0]) * 1000
    return int(columns(packet)["timestamp"][0])


@pytest.mark.parametrize("sensor", ALL)
@pytest.mark.parametrize(("step_s", "ppm"), [(0.3, 0.0), (-2.0, 0.0), (0.0, 1500.0)])
def test_a_shifted_clock_moves_all_stamps(sensor: str, step_s: float, ppm: float) -> None:
    before = packets(sensor)
    got = stream_faults.ShiftedClock(step_s, ppm)(before)
    moved = [stamp_ns(sensor, b) - stamp_ns(sensor, a) for a, b in zip(before, got, strict=True)]
    span = stamp_ns(sensor, before[-1]) - stamp_ns(sensor, before[0])
    assert moved[0] == pytest.approx(step_s * 1e9, abs=1000)
    assert moved[-1] == pytest.approx(step_s * 1e9 + span * ppm * 1e-6, abs=1000)
    for was, now in zip(before, got, strict=True):
        assert (rays(sensor, was)[1] == rays(sensor, now)[1]).all()
