"""Table of faults of a LiDAR's stream and clock: sensor, fault, and the cause to be named."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from copy import deepcopy
from dataclasses import dataclass, field
from functools import cache, partial
from typing import Any

import numpy as np

from companion.flight.sensors.diagnosis.sensor_surroundings import Surroundings
from sitl.faults import packet_edit, stream_faults
from sitl.faults.lidar_faults import Halved
from tests.unit.companion.flight.sensors.diagnosis.streams import WALL_NS, Bench, Loop, Treat, loop_of
from tests.unit.companion.flight.sensors.packets import imu_packet
from tests.unit.companion.flight.sensors.velodyne_packets import velodyne_packet

BEFORE_S, WITHIN_S = 5.0, 3.0
PTP, FREE = 1, 0
Packets = Iterator[tuple[int, bytes]]
AHEAD_NS = WALL_NS - 7_000_000_000  # of a sensor's clock that follows this computer's


def rng() -> np.random.Generator:
    """Return a generator with a fixed seed."""
    return np.random.default_rng(5)


def nothing(packets: list[bytes]) -> list[bytes]:
    """Drop all packets."""
    return []


def time_type(value: int) -> Treat:
    """Return the change of the source of a Livox sensor's stamps."""
    return lambda packets: [packet_edit.with_time_type(packet, value) for packet in packets]


def flipped() -> Treat:
    """Return the change of a bit in a tenth of the packets."""
    random = rng()

    def treat(packets: list[bytes]) -> list[bytes]:
        return [p[:-5] + bytes([p[-5] ^ 1]) + p[-4:] if random.random() < 0.1 else p for p in packets]

    return treat


def both(*treats: Treat) -> Treat:
    """Return changes one after another."""

    def treat(packets: list[bytes]) -> list[bytes]:
        for one in treats:
            packets = one(packets)
        return packets

    return treat


def position(pulse: int, sentence: bytes) -> bytes:
    """Return a Velodyne's position packet."""
    packet = bytearray(512)
    packet[202] = pulse
    packet[206 : 206 + len(sentence)] = sentence
    return bytes(packet)


VALID = b"$GPRMC,120000,A,4700.0,N,00800.0,E,0.0,0.0,010125,,,A*00\r\n"
INVALID = VALID.replace(b",A,4", b",V,4")


def beside(bench: Bench, packets: Packets, extra: bytes, every: int) -> Packets:
    """Yield packets with another one after every so many."""
    for k, (at_ns, packet) in enumerate(packets):
        yield at_ns, packet
        if k % every == 0:
            yield at_ns, extra


def imu_only(bench: Bench, first: int, last: int) -> Packets:
    """Yield inertial packets at the times of packets of points."""
    for number in range(first, last, 10):
        at_ns = round((number + 1) * bench.loop.packet_ns)
        yield at_ns, imu_packet(stamp_ns=7_000_000_000 + at_ns)


@cache
def fed_healthily(sensor: str) -> Bench:
    """Return the bench of a sensor without settings after its healthy seconds, to be copied."""
    bench = Bench(loop_of(sensor))
    bench.feed(bench.arrivals(0, bench.number_at(BEFORE_S)))
    return bench


@dataclass(frozen=True, slots=True)
class Case:
    """A fault that begins after five healthy seconds, or at once."""

    sensor: str
    name: str
    cause: str
    treat: Callable[[], Treat] | None = None
    around: Callable[[Bench], Surroundings] | None = None
    settings: dict[str, Any] = field(default_factory=dict)
    feed: Callable[[Bench, int, int], Packets] | None = None
    healthy: Callable[[Bench, int, int], Packets] | None = None
    from_start: bool = False
    metadata: dict[str, Any] = field(default_factory=dict)

    @property
    def title(self) -> str:
        """Name of the case in the list of tests."""
        return f"{self.sensor}-{self.name}"

    def loop(self) -> Loop:
        """Return the sensor's packets, with the metadata of the case."""
        loop = loop_of(self.sensor)
        if not self.metadata:
            return loop
        document = json.loads(loop.metadata)
        for section, values in self.metadata.items():
            document[section] |= values
        return Loop(loop.kind, loop.packets, loop.packet_ns, json.dumps(document))

    def run(self) -> tuple[Bench, float]:
        """Feed the case; return the bench and the second in which the fault began."""
        copied = not (self.from_start or self.settings or self.sensor == "os1")  # whose decoder has no copy
        bench = deepcopy(fed_healthily(self.sensor)) if copied else Bench(self.loop(), **self.settings)
        if self.around is not None:
            around = self.around
            bench.stream.diagnosis.surroundings = lambda: around(bench)
        begin_s = 0.0 if self.from_start else BEFORE_S
        begin, end = bench.number_at(begin_s), bench.number_at(begin_s + WITHIN_S + 1.0)
        made = {"ahead_ns": AHEAD_NS, "drift_ppm": 0.0} if self.settings else {}
        if not (self.from_start or copied):
            healthy = bench.arrivals(0, begin, self.base(), **made)
            bench.feed(healthy if self.healthy is None else self.healthy(bench, 0, begin))
        if self.feed is not None:
            bench.feed(self.feed(bench, begin, end))
        else:
            treat = both(self.base(), nothing if self.treat is None else self.treat())
            bench.feed(bench.arrivals(begin, end, treat, **made))
        bench.pass_time(round((begin_s + WITHIN_S + 1.0) * 1e9))
        return bench, begin_s

    def base(self) -> Treat:
        """Return what a healthy sensor of the case does: with `lidar_clock=ptp` it says so."""
        if self.sensor == "mid360" and self.settings.get("lidar_clock") == "ptp":
            return time_type(PTP)
        return lambda packets: packets


def pause(seconds: float, renumber: bool = False) -> Callable[[Bench, int, int], Packets]:
    """Return a feed that stops for some seconds; renumber: the sensor did not count meanwhile."""

    def feed(bench: Bench, first: int, last: int) -> Packets:
        gap = bench.number_at(seconds)
        for at_ns, packet in bench.arrivals(first + gap, last):
            number = packet_edit.number_of(packet) - gap
            yield at_ns, packet_edit.numbered(packet, number) if renumber else packet

    return feed


def with_positions(pulse: int, sentence: bytes) -> Callable[[Bench, int, int], Packets]:
    """Return a feed with position packets between the points."""
    return lambda bench, first, last: beside(
        bench,
        bench.arrivals(first, last, ahead_ns=AHEAD_NS, drift_ppm=0.0),
        position(pulse, sentence),
        14,
    )


def second_sensor(bench: Bench, first: int, last: int) -> Packets:
    """Feed packets of two sensors to one port."""
    for at_ns, packet in bench.arrivals(first, last):
        bench.pass_time(at_ns)
        bench.stream.add_packet(packet, "192.168.1.101", at_ns)
        yield at_ns, packet


def dropping(bench: Bench) -> Surroundings:
    """Return surroundings in which the kernel drops all that is lost."""
    return Surroundings(dropped=int(bench.stream.statistics()["lost_packets"] or 0))


def each(name: str, cause: str, treat: Callable[[], Treat], *sensors: str) -> list[Case]:
    """Return a case for each sensor."""
    return [Case(sensor, name, cause, treat) for sensor in sensors or ALL]


ALL = ("mid360", "vlp16", "os1")
STEPS = (0.1, 5.0, -0.6)
CASES: tuple[Case, ...] = (
    *each("silent", "silent", lambda: nothing),
    *each("loss 4 %", "missing_packets", lambda: stream_faults.Loss(rng(), 0.04)),
    *each("loss 30 %", "missing_packets", lambda: stream_faults.Loss(rng(), 0.3)),
    *each("every second packet", "missing_packets", Halved),
    *each("half rate", "low_rate", stream_faults.HalfRate, "mid360", "os1"),
    *each("sector", "missing_sector", lambda: stream_faults.Sector(rng(), 40.0, 50.0), "vlp16", "os1"),
    *each("covered", "covered", lambda: stream_faults.Cover(rng(), -20.0, 40.0)),
    *each("dirt", "dirty", lambda: stream_faults.Dirt(rng(), -30.0, 50.0)),
    *each("dead row", "dead_lines", lambda: stream_faults.DeadRow(2)),
    *(
        case
        for step_s in STEPS
        for case in each(f"step {step_s:g} s", "step", partial(stream_faults.ShiftedClock, step_s))
    ),
    *each("fast clock", "drift", lambda: stream_faults.ShiftedClock(0.0, 1500.0), "mid360", "vlp16"),
    *each("slow clock", "drift", lambda: stream_faults.ShiftedClock(0.0, -1500.0), "mid360", "vlp16"),
    # Its packets here are 6 ms apart: a drift is told once it makes up one of them.
    *each("fast clock", "drift", lambda: stream_faults.ShiftedClock(0.0, 4000.0), "os1"),
    *each("slow clock", "drift", lambda: stream_faults.ShiftedClock(0.0, -4000.0), "os1"),
    *(Case(sensor, "pause", "pauses", feed=pause(1.2)) for sensor in ALL),
    Case("mid360", "pause, uncounted", "pauses", feed=pause(1.2, renumber=True)),
    Case("mid360", "full buffer", "full_buffer", lambda: stream_faults.Loss(rng(), 0.1), dropping),
    Case("os1", "full buffer", "full_buffer", lambda: stream_faults.Loss(rng(), 0.1), dropping),
    Case("mid360", "muted by GPRMC", "muted", feed=imu_only),
    Case("mid360", "points to another port", "wrong_port", feed=imu_only, from_start=True),
    Case("mid360", "firewall", "firewall", around=lambda _: Surroundings(answers=True), from_start=True),
    Case("mid360", "refuses", "refusal", around=lambda _: Surroundings(False, "refused"), from_start=True),
    Case("mid360", "another host", "elsewhere", around=lambda _: Surroundings(present=True), from_start=True),
    Case("mid360", "other maker", "other_maker", lambda: lambda _: [velodyne_packet()], from_start=True),
    Case("os1", "other maker", "other_maker", lambda: lambda _: [velodyne_packet()], from_start=True),
    Case("mid360", "spoilt", "spoilt", flipped),
    Case("mid360", "two sensors", "two_sensors", feed=second_sensor),
    Case(
        "vlp16", "unknown model", "not_as_described", lambda: lambda p: [p[0][:-1] + b"\x21"], from_start=True
    ),
    Case(
        "os1",
        "stale metadata",
        "not_as_described",
        lambda: lambda p: p,
        metadata={
            "lidar_data_format": {
                "udp_profile_lidar": "RNG15_RFL8_NIR8",
            },
            "config_params": {"udp_profile_lidar": "RNG15_RFL8_NIR8"},
        },
        from_start=True,
    ),
    Case(
        "os1",
        "another host",
        "elsewhere",
        metadata={"config_params": {"udp_dest": "198.51.100.7"}},
        from_start=True,
    ),
    Case("mid360", "no PTP", "no_master", lambda: time_type(FREE), settings={"lidar_clock": "ptp"}),
    Case(
        "mid360",
        "another master",
        "other_master",
        lambda: stream_faults.ShiftedClock(-0.015),
        settings={"lidar_clock": "ptp", "lidar_delay_ms": 0.0},
    ),
    Case(
        "vlp16",
        "no PPS",
        "no_pps",
        settings={"lidar_clock": "gps"},
        healthy=with_positions(2, VALID),
        feed=with_positions(0, VALID),
    ),
    Case(
        "vlp16",
        "invalid GPRMC",
        "no_pps",
        settings={"lidar_clock": "gps"},
        healthy=with_positions(2, VALID),
        feed=with_positions(2, INVALID),
    ),
)
