"""Diagnosis of each fault of a stream and its clock, and silence about healthy ones."""

from __future__ import annotations

import inspect
import itertools
import re
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest

from companion.flight.sensors.diagnosis import explanation
from companion.flight.sensors.diagnosis.explanation import Explanation
from sitl.faults import stream_faults
from tests.unit.companion.flight.sensors import ouster_packets
from tests.unit.companion.flight.sensors.diagnosis import recorded_streams as streams
from tests.unit.companion.flight.sensors.diagnosis.faults import CASES, WITHIN_S, Case, pause
from tests.unit.companion.flight.sensors.diagnosis.recorded_streams import Make, RecordedBench
from tests.unit.companion.flight.sensors.diagnosis.streams import Bench, loop_of

needs_ouster = pytest.mark.skipif(bool(ouster_packets.MISSING), reason=ouster_packets.MISSING)
MARKS = {"os1": [needs_ouster]}
SENSORS = [pytest.param(name, marks=MARKS.get(name, [])) for name in ("mid360", "vlp16", "os1")]


@pytest.mark.parametrize(
    "case", [pytest.param(case, id=case.title, marks=MARKS.get(case.sensor, [])) for case in CASES]
)
def test_the_cause_is_named_within_three_seconds_and_no_other(case: Case) -> None:
    bench, began_s = case.run()
    assert [told.cause for told in bench.told] == [case.cause]
    assert 0.0 <= bench.told[0].at_s - began_s <= WITHIN_S


@pytest.mark.parametrize("sensor", SENSORS)
def test_a_healthy_stream_raises_no_alarm(sensor: str) -> None:
    bench = Bench(loop_of(sensor))
    bench.feed(bench.arrivals(0, bench.number_at(12.0)))
    assert bench.told == []


@pytest.mark.parametrize("drift_ppm", [-60.0, 60.0])
def test_an_oscillator_of_sixty_millionths_is_healthy(drift_ppm: float) -> None:
    bench = Bench(loop_of("vlp16"))
    bench.feed(bench.arrivals(0, bench.number_at(15.0), drift_ppm=drift_ppm))
    assert bench.told == []


def test_a_busy_computer_is_no_fault_of_the_sensor() -> None:
    bench = Bench(loop_of("vlp16"))
    for number, (at_ns, packet) in enumerate(bench.arrivals(0, bench.number_at(20.0))):
        stalled_ns = 700_000_000 if number // 1000 % 2 else 0  # packets wait in the socket, none is dropped
        late_ns = max(at_ns, at_ns // 2_000_000_000 * 2_000_000_000 + stalled_ns)
        bench.feed(iter([(late_ns, packet)]))
    assert bench.told == []


def test_a_fault_is_told_once_and_its_end_is_known() -> None:
    bench = Bench(loop_of("vlp16"))
    bench.feed(bench.arrivals(0, bench.number_at(5.0)))
    bench.feed(pause(1.2)(bench, bench.number_at(5.0), bench.number_at(8.0)))
    assert [told.cause for told in bench.told] == ["pauses"]
    assert bench.stream.diagnosis.active
    bench.feed(bench.arrivals(bench.number_at(8.0), bench.number_at(16.0)))
    assert bench.stream.diagnosis.active == []
    (episode,) = bench.episodes
    assert episode.ended_ns is not None
    assert 6e9 < episode.began_ns <= episode.ended_ns < 9e9


class Placed:
    """Scans of which each look sees the next number of repeated returns, and the next error of the mount."""

    def __init__(self, repeated: Iterator[int] | None = None, errors: Iterator[Any] | None = None) -> None:
        self._repeated = itertools.repeat(0) if repeated is None else repeated
        self._errors = itertools.repeat(None) if errors is None else errors

    @property
    def repeated(self) -> int:
        return next(self._repeated)

    @property
    def mount_error_deg(self) -> tuple[float, float] | None:
        return next(self._errors)  # type: ignore[no-any-return]


def test_a_picture_that_repeats_is_named_alone_and_only_while_it_does() -> None:
    bench = Bench(loop_of("vlp16"))
    repeated = iter([0] * 20 + list(range(300, 3_300, 300)) + [3_000] * 1_000)
    bench.stream.diagnosis.placed = Placed(repeated=repeated)
    bench.feed(bench.arrivals(0, bench.number_at(20.0)))
    assert [told.cause for told in bench.told] == ["repeats"]
    (episode,) = bench.episodes
    assert episode.ended_ns is not None
    assert 4.9e9 < episode.began_ns < 5.6e9
    assert 7e9 < episode.ended_ns < 9e9


def test_a_mount_that_the_scans_show_to_be_wrong_is_named_alone_once() -> None:
    bench = Bench(loop_of("vlp16"))
    errors = iter([None] * 20 + [(1.2, -9.8)] * 1_000)
    bench.stream.diagnosis.placed = Placed(errors=errors)
    bench.feed(bench.arrivals(0, bench.number_at(20.0)))
    assert [told.cause for told in bench.told] == ["mount"]
    (episode,) = bench.episodes
    assert episode.ended_ns is None
    assert episode.explanation.text == "LiDAR mount looks wrong by 10 deg in pitch"
    assert "+1.2 degrees in the vehicle's roll and -9.8 in its pitch" in episode.explanation.sentence


def test_losses_now_and_then_are_one_episode() -> None:
    bench = Bench(loop_of("vlp16"))
    bench.feed(bench.arrivals(0, bench.number_at(5.0)))
    for k in range(5, 25, 4):
        loss = stream_faults.Loss(bench_rng(), 0.3)
        bench.feed(bench.arrivals(bench.number_at(k), bench.number_at(k + 2), loss))
        bench.feed(bench.arrivals(bench.number_at(k + 2), bench.number_at(k + 4)))
    assert [told.cause for told in bench.told] == ["missing_packets"]


def bench_rng() -> stream_faults.np.random.Generator:
    return stream_faults.np.random.default_rng(9)


def explanations(described: bool, undecoded: str = "a Hesai LiDAR PandarXT-32") -> list[Explanation]:
    """Return one of each, with its longest numbers."""
    longest = {
        "described": described,
        "address": "192.168.100.100",
        "rows": [100, 101, 102, 103],
        "state": "GPRMC not valid",
    }
    longest |= {
        "bound": "192.168.100.100",
        "undecoded": undecoded,
        "source": "PTP",
        "why": "the LiDAR refuses parameter 0x0006 (code 32)",
    }
    numbers = {
        "seconds": 100.0,
        "share": 1.0,
        "from_deg": 350.0,
        "to_deg": 350.0,
        "step_s": -99.9,
        "ppm": -49e3,
        "roll_deg": 3.0,
        "pitch_deg": -14.0,
    }
    found = []
    for _, make in inspect.getmembers(explanation, inspect.isfunction):
        if inspect.signature(make).return_annotation == "Explanation":
            names = inspect.signature(make).parameters
            found.append(make(*((longest | numbers)[name] for name in names)))
    return found


def test_each_explanation_fits_a_statustext_and_has_a_remedy() -> None:
    made = [*explanations(described=False), *explanations(described=True)]
    assert len(made) > 40
    for one in made:
        assert len(f"SLZ: {one.text}") <= 50, one.text
        assert one.text.isascii()
        assert one.remedy
        assert one.line == f"{one.sentence}: {one.remedy}"


def test_metadata_are_named_to_those_whose_sensor_has_them() -> None:
    told = [one.line for one in explanations(described=False, undecoded="")]
    assert not [line for line in told if re.search("metadata|Ouster|udp_dest", line)]
    assert sum("metadata" in one.line for one in explanations(described=True, undecoded="")) == 3


# Diagnosis of recorded packets, healthy and with faults on which no threshold was found.


BEFORE_S, FOUND_WITHIN_S = 4.0, 3.0
FAULTS: dict[str, tuple[Make, float]] = {
    "missing_packets": (streams.lost, 0.07),
    "low_rate": (streams.halved, 0.0),
    "missing_sector": (streams.unmeasured, 37.0),
    "dirty": (streams.dirty, 33.0),
    "step": (streams.stepped, -0.21),
    "pauses": (streams.silenced, 0.7),
}


@pytest.mark.parametrize("cause", FAULTS)
@pytest.mark.parametrize("sensor", ["vlp16", "os0"])
def test_a_fault_of_a_recorded_stream_is_named_alone_and_the_stream_before_it_is_healthy(
    sensor: str, cause: str
) -> None:
    if (sensor, cause) == ("vlp16", "low_rate"):
        pytest.skip("a Velodyne numbers no frames: at half the rate its packets are missing")
    bench = RecordedBench(sensor, 404)
    bench.feed(0.0, BEFORE_S)
    assert bench.told == []
    make, strength = FAULTS[cause]
    change = make(np.random.default_rng(404), bench.recorded, strength)
    bench.feed(BEFORE_S, BEFORE_S + FOUND_WITHIN_S + 0.25, change)
    ((at_s, named),) = bench.told
    assert named == cause
    assert at_s - BEFORE_S <= FOUND_WITHIN_S
