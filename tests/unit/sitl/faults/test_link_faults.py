"""Datagrams on a faulty link."""

from __future__ import annotations

import numpy as np
import pytest

from sitl import scenes
from sitl.faults import FaultyWire, build, link_faults
from sitl.faults.link_faults import Treatment
from sitl.simulation import Simulation
from sitl.wire.wire import MemoryWire

SECOND = 1_000_000_000


class Line:
    """A spoilt wire, its two ends, and its clock."""

    def __init__(self, treatment: Treatment | None) -> None:
        self.now_ns = 0
        self.inner = MemoryWire()
        self.wire = FaultyWire(self.inner, np.random.default_rng(1), lambda: self.now_ns)
        self.wire.treatment = treatment

    def sent(self, count: int, every_ns: int = SECOND // 50) -> list[tuple[int, bytes]]:
        """Send numbered datagrams both ways; return when each arrived outside."""
        arrived: list[tuple[int, bytes]] = []
        inward: list[bytes] = []
        for k in range(count + 100):
            self.now_ns = k * every_ns
            if k < count:
                self.wire.peers[0].write(k.to_bytes(4, "big"))
                self.inner.send(k.to_bytes(4, "big"))
            inward += [data for _, data in self.wire.poll()]
            arrived += [(self.now_ns, data) for data in self.inner.received]
            self.inner.received.clear()
        self.inward = inward
        return arrived


def numbers(arrived: list[tuple[int, bytes]]) -> list[int]:
    return [int.from_bytes(data, "big") for _, data in arrived]


def test_without_a_treatment_everything_passes_at_once_both_ways() -> None:
    line = Line(None)
    assert line.sent(50) == [(k * SECOND // 50, k.to_bytes(4, "big")) for k in range(50)]
    assert line.inward == [k.to_bytes(4, "big") for k in range(50)]


def test_a_lost_link_passes_nothing_either_way() -> None:
    line = Line(link_faults.Loss())
    assert line.sent(50) == []
    assert line.inward == []


def test_bursts_lose_thirty_percent_in_runs() -> None:
    got = set(numbers(Line(link_faults.Bursts()).sent(20_000)))
    lost = np.array([k not in got for k in range(20_000)])
    assert lost.mean() == pytest.approx(0.3, abs=0.03)
    runs = np.diff(np.flatnonzero(np.diff(np.concatenate([[0], lost, [0]]))))[::2]
    assert runs.mean() > 20  # of 50 datagrams a second: 0.6 s


def test_a_delayed_datagram_comes_half_a_second_late_in_its_order() -> None:
    arrived = Line(link_faults.Delay()).sent(50)
    assert numbers(arrived) == list(range(50))
    assert {at - k * SECOND // 50 for k, (at, _) in enumerate(arrived)} == {SECOND // 2}


def test_three_of_ten_datagrams_come_twice() -> None:
    found = numbers(Line(link_faults.Duplicates()).sent(2000))
    assert set(found) == set(range(2000))
    assert len(found) == pytest.approx(2600, abs=80)


def test_reordering_loses_nothing() -> None:
    found = numbers(Line(link_faults.Reordering()).sent(500))
    assert sorted(found) == list(range(500))
    assert found != sorted(found)


def test_one_of_five_datagrams_is_corrupted() -> None:
    data = bytes(range(200))
    rng = np.random.default_rng(2)
    treat = link_faults.Corruption()
    spoilt = [rest != data for _ in range(2000) for _, rest in treat(data, rng, 0)]
    assert np.mean(spoilt) == pytest.approx(0.2, abs=0.03)


def test_a_link_fault_needs_a_spoilt_wire() -> None:
    with pytest.raises(ValueError, match="FaultyWire"):
        build("link_loss", np.random.default_rng(0)).start(
            Simulation(scenes.build("landing_site", 1), [MemoryWire()])
        )


def test_an_unknown_fault_is_refused_with_the_names_of_all() -> None:
    with pytest.raises(ValueError, match=r"'rust' is unknown; choose one of link_loss, .*lidar_rain"):
        build("rust", np.random.default_rng(0))
