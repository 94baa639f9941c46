"""Ouster decoder against packets built from the manual, a real recording, and garbage."""

from __future__ import annotations

import asyncio
import json
import math
import sys
from pathlib import Path

import dpkt
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from companion.flight.sensors.decoders import ouster_decoder
from companion.flight.sensors.decoders.ouster_decoder import OusterDecoder
from companion.flight.sensors.lidar_url import open_lidar
from companion.runtime.errors import UsageError
from params import Parameters
from tests.unit.companion.flight.sensors.ouster_packets import (
    DUAL,
    LEGACY,
    LOW,
    MISSING,
    SINGLE,
    metadata,
    only,
    ouster_packet,
)
from tests.unit.companion.flight.sensors.recordings import recording

pytestmark = pytest.mark.skipif(bool(MISSING), reason=MISSING)

PROFILES = (SINGLE, DUAL, LOW, LEGACY)
PACKETS = 32  # a frame
PACKET_NS = 16 * 195_312


def decoder(profile: str = SINGLE) -> OusterDecoder:
    return OusterDecoder(metadata(profile))


@pytest.mark.parametrize("profile", PROFILES)
@pytest.mark.parametrize(
    ("column", "forward", "left"),
    [(0, -1, 0), (128, 0, 1), (256, 1, 0), (384, 0, -1)],  # begins behind, over the connector, and goes left
)
def test_a_return_is_forward_left_up(profile: str, column: int, forward: float, left: float) -> None:
    raw = decoder(profile).decode([ouster_packet(only(3, 0), profile=profile, column=column)])
    elevation = math.radians(45 - 3 * 6)
    flat, up = 10.0 * math.cos(elevation), 10.0 * math.sin(elevation) + 0.036
    np.testing.assert_allclose(raw.xyz_m, [[flat * forward, flat * left, up]], atol=1e-4)
    assert (raw.intensity.tolist(), raw.ring.tolist()) == ([77], [12])
    assert (raw.echo.tolist(), raw.echoes.tolist()) == ([1], [1])
    assert (raw.xyz_m.dtype, raw.stamp_ns.dtype) == (np.float32, np.int64)


@pytest.mark.parametrize("profile", PROFILES)
def test_a_point_has_its_column_s_stamp_and_the_last_is_known_before_decoding(profile: str) -> None:
    d = decoder(profile)
    epoch_ns = 1_790_000_000_123_456_789
    packet = ouster_packet(lambda row, column: (8000, column), profile=profile, stamp_ns=epoch_ns)
    assert d.check(packet) == epoch_ns + 15 * 195_312
    raw = d.decode([packet])
    np.testing.assert_array_equal(raw.stamp_ns, epoch_ns + raw.intensity.astype(np.int64) * 195_312)
    assert len(raw) == 256


@pytest.mark.parametrize(
    ("strong_mm", "second_mm", "echoes", "metres"),
    [
        (10_000, 8_000, [2, 1], [10.0, 8.0]),
        (10_000, 12_000, [1, 2], [10.0, 12.0]),
        (10_000, 0, [1], [10.0]),
        (0, 8_000, [1], [8.0]),
    ],
)
def test_both_returns_of_a_ray_are_numbered_by_distance(
    strong_mm: int, second_mm: int, echoes: list[int], metres: list[float]
) -> None:
    d = decoder(DUAL)
    raw = d.decode([ouster_packet(only(7, 2, strong_mm), only(7, 2, second_mm), profile=DUAL)])
    assert raw.echo.tolist() == echoes
    assert set(raw.echoes) == {len(echoes)}
    np.testing.assert_allclose(np.linalg.norm(raw.xyz_m - [0, 0, 0.036], axis=1), metres, atol=1e-4)
    assert (d.counters.returns, d.counters.no_return) == (len(echoes), 255)


def test_a_batch_equals_its_packets_one_by_one() -> None:
    packets = [
        ouster_packet(
            lambda row, c, i=i: (1000 * (row + c) * ((row + i) % 2), row),  # type: ignore[misc]
            lambda row, c: (500 * row, c),
            profile=DUAL,
            column=16 * i,
            stamp_ns=10**9 + i * PACKET_NS,
        )
        for i in range(5)
    ]
    together, alone = decoder(DUAL).decode(packets), [decoder(DUAL).decode([p]) for p in packets]
    for name in ("xyz_m", "stamp_ns", "intensity", "ring", "echo", "echoes"):
        expected = np.concatenate([getattr(one, name) for one in alone])
        np.testing.assert_array_equal(getattr(together, name), expected)


GOOD = ouster_packet(only(1, 1))


@pytest.mark.parametrize(
    ("packet", "counter"),
    [
        (b"", "malformed"),
        (GOOD[:-1], "malformed"),
        (GOOD + b"\0", "malformed"),
        (ouster_packet(kind=2), "malformed"),
        (ouster_packet(column=500), "malformed"),
        (ouster_packet(column_ns=-1), "malformed"),
        (ouster_packet(column_ns=10**9), "malformed"),
        (ouster_packet(stamp_ns=2**63), "malformed"),
        (ouster_packet(valid=False), "empty"),
        (bytes(48), "imu"),
    ],
)
def test_a_bad_packet_is_counted_and_the_good_one_after_it_is_read(packet: bytes, counter: str) -> None:
    d = decoder()
    assert len(d.decode([packet, GOOD])) == 1
    c = d.counters
    assert (getattr(c, counter), c.malformed + c.empty + c.imu, c.packets) == (1, 1, 1)


@settings(derandomize=True, max_examples=60, deadline=None)
@given(
    profile=st.sampled_from(PROFILES),
    size=st.integers(0, 3392),
    flips=st.lists(st.integers(0, 1280 * 8 - 1), max_size=8),
)
def test_truncated_and_flipped_packets_never_raise(profile: str, size: int, flips: list[int]) -> None:
    packet = bytearray(ouster_packet(only(1, 1), profile=profile))
    for bit in flips:
        packet[bit // 8] ^= 1 << bit % 8
    d = decoder(profile)
    raw = d.decode([bytes(packet[:size]), bytes(packet)])
    c = d.counters
    assert c.packets + c.imu + c.empty + c.malformed == 2
    assert len(raw) == c.returns
    assert np.isfinite(raw.xyz_m).all()
    assert (raw.stamp_ns >= 0).all()


@pytest.mark.parametrize(
    ("numbers", "lost"),
    [
        ([0, 1, 2, 3], 0),
        ([0, 1, 4, 5], 2),
        ([30, 31, 32, 33], 0),  # from one frame to the next
        ([30, 34], 3),
        ([65_536 * PACKETS - 1, 65_536 * PACKETS], 0),  # frames go round
        ([0, 2, 1, 3], 0),  # one overtook another
        ([0, 1, 1, 2], 0),
        ([0, 11 * PACKETS], 0),  # switched off and on
    ],
)
def test_lost_packets_are_counted(numbers: list[int], lost: int) -> None:
    d = decoder()
    for n in numbers:
        d.decode([ouster_packet(frame=n // PACKETS % 65_536, column=n % PACKETS * 16)])
    assert d.counters.lost_packets == lost


@pytest.mark.parametrize("metadata", ["", "nonsense", "{}", "[1]"])
def test_metadata_that_cannot_be_read_is_one_clear_line(metadata: str) -> None:
    with pytest.raises(UsageError, match="metadata cannot be read") as error:
        OusterDecoder(metadata)
    assert "\n" not in str(error.value)


def test_a_url_names_the_metadata(tmp_path: Path) -> None:
    file = tmp_path / "os0.json"
    file.write_text(metadata())
    driver = open_lidar(f"ouster:192.0.2.1?meta={file}", Parameters(), print)
    with pytest.raises(UsageError, match=r"^LiDAR ouster:192\.0\.2\.1:7502: "):  # no address of this machine
        asyncio.run(asyncio.wait_for(driver.run(), 5))
    assert (driver.stream.kind, driver.stream.metadata) == ("ouster", metadata())


@pytest.mark.parametrize(
    ("query", "says"),
    [
        ("", "sensor/metadata"),
        ("?meta=", "sensor/metadata"),
        ("?x=1", "metadata"),
        ("?meta=/no/file", "No such"),
    ],
)
def test_a_url_without_metadata_is_one_clear_line(query: str, says: str) -> None:
    with pytest.raises(UsageError, match=says):
        open_lidar(f"ouster:0.0.0.0:7502{query}", Parameters(), print)


def test_without_the_package_one_line_says_how_to_install_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "ouster.sdk.core", None)
    with pytest.raises(UsageError, match=r"pip install 'slz\[ouster\]'"):
        OusterDecoder("any")


@pytest.mark.parametrize(
    ("said", "line"),
    [
        (
            "libGL.so.1: cannot open shared object file",
            r"without libGL.so.1 \(Debian: sudo apt install libgl1\)",
        ),
        ("libstdc++.so.6: version not found", r"without libstdc\+\+.so.6$"),
    ],
)
def test_without_a_library_of_the_system_one_line_names_it(
    monkeypatch: pytest.MonkeyPatch, said: str, line: str
) -> None:
    def refused(name: str) -> None:
        raise ImportError(said)

    monkeypatch.setattr(ouster_decoder, "import_module", refused)
    with pytest.raises(UsageError, match=line):
        OusterDecoder("any")


def test_a_real_recording_gives_all_its_returns() -> None:
    name = "ouster_os0/OS-0-128-U1_v2.3.0_1024x10"
    d = OusterDecoder(recording(f"{name}.json").read_text())
    with recording(f"{name}.pcap").open("rb") as file:
        frames = [dpkt.ethernet.Ethernet(data) for _, data in dpkt.pcap.Reader(file)]
    raw = d.decode([bytes(frame.data.data.data) for frame in frames])
    c = d.counters
    assert (len(raw), c.packets, c.imu, c.malformed, c.lost_packets) == (97_299, 64, 10, 0, 0)
    assert raw.stamp_ns[-1] - raw.stamp_ns[0] == pytest.approx(100e6, rel=0.01)
    elevation = np.degrees(np.arctan2(raw.xyz_m[:, 2], np.hypot(*raw.xyz_m[:, :2].T)))
    medians = [np.median(elevation[raw.ring == ring]) for ring in (0, 64, 127)]
    np.testing.assert_allclose(medians, [-45, 0, 46], atol=3)


def test_metadata_that_places_points_nowhere_is_one_clear_line() -> None:
    told = json.loads(metadata())
    told["lidar_intrinsics"]["lidar_to_sensor_transform"][3] = 1e9  # a thousand kilometres forward
    with pytest.raises(UsageError, match="places points nowhere: fetch it again") as error:
        OusterDecoder(json.dumps(told))
    assert "\n" not in str(error.value)


def test_a_packet_beside_the_sensor_s_window_is_decoded_and_no_loss() -> None:
    told = json.loads(metadata())
    told["lidar_data_format"]["column_window"] = [0, 255]
    d = OusterDecoder(json.dumps(told))
    columns = (0, 400, 16, 416, 32)
    raw = d.decode([ouster_packet(only(3, 0), column=column) for column in columns])
    assert (len(raw), d.counters.packets, d.counters.lost_packets) == (5, 5, 0)
