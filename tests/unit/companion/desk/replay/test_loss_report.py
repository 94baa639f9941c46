"""Report of a replay on lost returns, and on a map without a zone."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import dpkt
import pytest

from companion.desk.replay.foreign_replay import Rerun
from companion.desk.replay.loss_report import lost_for_time, not_mapped, why_no_zone
from companion.desk.replay.own_replay import ReplayOutcome
from companion.runtime.errors import UsageError
from tests.unit.companion.desk.replay import flights
from tests.unit.companion.desk.replay.flights import BEGIN_NS
from tests.unit.companion.desk.replay.test_others import again

NONE_LOST = {"read": 1000, "without_pose": 0, "stale": 0}
HEADER_BYTES, CHECKSUM = 36, slice(24, 28)


def write_zeros(path: Path, every: int) -> Path:
    """Write the flight's packets, of which one in so many has returns, and the others only zeros."""
    with path.open("wb") as file:
        writer = dpkt.pcap.Writer(file, linktype=101)
        for k, (at_ns, data) in enumerate(flights.packets()):
            packet = bytearray(data)
            if (k + 1) % every:
                packet[CHECKSUM] = bytes(4)
                packet[HEADER_BYTES:] = bytes(len(packet) - HEADER_BYTES)
            udp = bytes(dpkt.udp.UDP(sport=56300, dport=56301, data=bytes(packet), ulen=8 + len(packet)))
            ip = dpkt.ip.IP(src=b"\x0a\x00\x00\x01", dst=bytes(4), p=17, len=20 + len(udp), data=udp)
            writer.writepkt(bytes(ip), (BEGIN_NS + at_ns) * 1e-9)
    return path


def test_an_empty_map_says_why(tmp_path: Path) -> None:
    log = flights.write_tlog(tmp_path / "flight.tlog")
    summary = again(log, points=str(write_zeros(tmp_path / "some.pcap", 200)))
    assert summary["zones"] == []
    zeros = summary["source"]["packets"]["no_return"]
    assert zeros > 90_000
    assert f"{zeros} measurements were no return (zeros or NaN)" in summary["why_no_zones"]
    assert "without a square of 3 m" in summary["why_no_zones"]
    with pytest.raises(UsageError, match=r"no return of the LiDAR; \d+ measurements were no return \(zeros"):
        again(log, points=str(write_zeros(tmp_path / "none.pcap", 10**9)))


def test_a_map_with_zones_needs_no_reason(tmp_path: Path) -> None:
    log = flights.write_tlog(tmp_path / "flight.tlog")
    summary = again(log, points=str(flights.write_pcap(tmp_path / "lidar.pcap")))
    assert summary["zones"]
    assert summary["why_no_zones"] == ""


@pytest.mark.parametrize(
    ("source", "returns", "says"),
    [
        ({}, {"without_pose": 7}, "7 of 1000 returns have no poses around them"),
        (
            {},
            {"attitudes_too_far_apart": 3, "attitude_error_deg": 4.4},
            "attitudes are 3 times too far apart for the vehicle's turns: they would err by up to 4.4"
            " degrees; what is between is left out; record 25 a second",
        ),
        ({}, {"stale": 7}, "7 of 1000 returns were too far from any pose (pose_timeout_s)"),
        ({"points": 90, "points_outside_log": 7}, {}, "7 of 90 points were not measured during the log"),
        (
            {"points": 90, "before_position": 7},
            {},
            "7 of 90 points were measured before the first position",
        ),
        (
            {"points_with_false_times": 7},
            {},
            "7 points were dropped: their times are far from those of their clouds",
        ),
        (
            {"clouds": 9, "clouds_without_point_times": 7, "why_no_point_times": "of that"},
            {},
            "7 of 9 clouds have no usable times of points, so they are not de-skewed: of that",
        ),
        (
            {"clouds": 9, "clouds_without_point_times": 7, "why_no_point_times": ""},
            {},
            "7 of 9 clouds are left out: the times of their points are unlike those of the others",
        ),
        (
            {"times": "seconds since 1970", "times_in_header": "standard GPS time"},
            {},
            "times of points are seconds since 1970, though the header tells standard GPS time",
        ),
        ({"packets": {"clock_resets": 2}}, {}, "the LiDAR's clock jumped 2 times"),
        ({"packets": {"clock_resets": 0}, "times": "one", "times_in_header": "one"}, {}, None),
    ],
)
def test_what_is_lost_for_time_is_said(
    source: dict[str, Any], returns: dict[str, float], says: str | None
) -> None:
    assert lost_for_time(source, NONE_LOST | returns) == ([] if says is None else [says])


def test_a_flight_without_windows_says_so() -> None:
    assert why_no_zone(ReplayOutcome(), None, flights.PARAMETERS) == "no window was mapped"
    failed = ReplayOutcome(windows=3, failed=3)
    assert why_no_zone(failed, None, flights.PARAMETERS).startswith("3 of 3 windows failed")


class Told:
    """A feed of which nothing but its counts is asked."""

    cut = ""
    bad = 0

    def summary(self) -> dict[str, Any]:
        return {"points_without_return": 5, "packets": {"foreign": 4}}

    def steps(self, rerun: Rerun) -> Any:
        raise NotImplementedError


def test_a_vehicle_on_the_ground_is_told_as_the_reason_of_an_empty_map() -> None:
    rerun = Rerun(flights.PARAMETERS)
    rerun.standing_scans = 12
    assert not_mapped(Told(), rerun) == [
        "5 measurements were no return (zeros or NaN)",
        "4 packets were another sensor's",
        "12 scans were made while the vehicle stood on the ground",
    ]
