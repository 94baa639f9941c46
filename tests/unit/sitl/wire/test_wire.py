"""Message router with ArduPilot's rules, over links of configurable quality."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from sitl.wire.wire import LinkModel, MemoryWire, Router

COMPANION = 191
STATION = 255, 190
LATE_NS = 10_000_000_000


class Station:
    """Somebody at the far end of an in-memory wire."""

    def __init__(self, system: int, component: int) -> None:
        self.wire = MemoryWire()
        self.codec: Any = mavlink.MAVLink(None, srcSystem=system, srcComponent=component)
        self.codec.robust_parsing = True

    def send(self, message: Any) -> bytes:
        data = bytes(message.pack(self.codec))
        self.codec.seq = (self.codec.seq + 1) % 256
        self.wire.send(data)
        return data

    def heard(self) -> list[Any]:
        data = b"".join(self.wire.received)
        self.wire.received.clear()
        return self.codec.parse_buffer(bytearray(data)) or []

    def kinds(self) -> list[str]:
        return [m.get_type() for m in self.heard()]


class Net:
    """A ground station, a companion and a second ground station, each on a wire of its own."""

    def __init__(self, seed: int = 7) -> None:
        self.delivered: list[Any] = []
        self.station, self.companion, self.other = Station(*STATION), Station(1, COMPANION), Station(254, 190)
        ends = [self.station, self.companion, self.other]
        self.router = Router(
            [end.wire for end in ends], np.random.default_rng(seed), lambda m, _link: self.delivered.append(m)
        )
        for end in ends:
            end.send(heartbeat())
        self.router.read(0)
        for end in ends:
            end.heard()
        self.delivered.clear()

    def read(self, now_ns: int = 1) -> list[str]:
        self.router.read(now_ns)
        return [m.get_type() for m in self.delivered]


def heartbeat() -> Any:
    return mavlink.MAVLink_heartbeat_message(mavlink.MAV_TYPE_GCS, 8, 0, 0, 4, 3)


def command(system: int, component: int) -> Any:
    return mavlink.MAVLink_command_long_message(system, component, mavlink.MAV_CMD_USER_1, 0, *[0.0] * 7)


def text(message: str = "hello") -> Any:
    return mavlink.MAVLink_statustext_message(6, message.encode(), 0, 0)


# ---- routing -------------------------------------------------------------------------------------------


def test_a_broadcast_goes_to_the_autopilot_and_to_every_other_link_but_not_back() -> None:
    net = Net()
    net.companion.send(text())
    assert net.read() == ["STATUSTEXT"]
    assert (net.station.kinds(), net.other.kinds()) == (["STATUSTEXT"], ["STATUSTEXT"])
    assert net.companion.kinds() == []


def test_a_command_to_a_component_goes_to_its_link_alone_and_unchanged() -> None:
    net = Net()
    frame = net.station.send(command(1, COMPANION))
    assert net.read() == []
    assert net.companion.wire.received == [frame]
    assert net.other.kinds() == []


def test_two_components_of_one_system_are_told_apart() -> None:
    net = Net()
    net.other.codec.srcSystem, net.other.codec.srcComponent = 1, COMPANION + 1
    net.other.send(heartbeat())
    net.read()
    net.companion.heard()
    net.station.send(command(1, COMPANION + 1))
    net.read()
    assert net.other.kinds() == ["COMMAND_LONG"]
    assert net.companion.kinds() == []


def test_the_answer_finds_its_way_back_to_the_station_that_asked() -> None:
    net = Net()
    net.companion.send(mavlink.MAVLink_command_ack_message(mavlink.MAV_CMD_USER_1, 0, 0, 0, *STATION))
    assert net.read() == []
    assert net.station.kinds() == ["COMMAND_ACK"]
    assert net.other.kinds() == []


def test_a_command_to_the_autopilot_is_carried_to_nobody_else() -> None:
    net = Net()
    net.station.send(command(1, 1))
    assert net.read() == ["COMMAND_LONG"]
    assert (net.companion.kinds(), net.other.kinds()) == ([], [])


def test_a_command_to_all_components_reaches_the_autopilot_and_the_companion() -> None:
    net = Net()
    net.station.send(command(1, 0))
    assert net.read() == ["COMMAND_LONG"]
    assert net.companion.kinds() == ["COMMAND_LONG"]
    assert net.other.kinds() == []


def test_a_command_to_another_system_is_not_for_the_autopilot() -> None:
    net = Net()
    net.companion.send(command(254, 0))
    assert net.read() == []
    assert net.other.kinds() == ["COMMAND_LONG"]


def test_a_component_that_moves_to_another_link_is_followed() -> None:
    net = Net()
    net.other.codec.srcSystem, net.other.codec.srcComponent = 1, COMPANION
    net.other.send(heartbeat())
    net.read()
    net.other.heard()
    net.companion.heard()
    net.station.send(command(1, COMPANION))
    net.read()
    assert net.other.kinds() == ["COMMAND_LONG"]
    assert net.companion.kinds() == []


def test_the_autopilot_sends_to_one_link_or_to_all_and_each_counts_its_own_frames() -> None:
    net = Net()
    peer = net.companion.wire.peers[0]
    net.router.send(net.router.number(peer), text("to one"))
    net.router.send(None, text("to all"))
    ours, theirs = net.companion.heard(), net.station.heard()
    assert [m.text for m in ours] == ["to one", "to all"]
    assert [m.text for m in theirs] == ["to all"]
    assert [m.get_seq() for m in ours] == [0, 1]
    assert [m.get_seq() for m in theirs] == [0]
    assert (theirs[0].get_srcSystem(), theirs[0].get_srcComponent()) == (1, 1)


@pytest.mark.parametrize("split", [1, 3, 7])
def test_frames_arrive_whole_however_the_bytes_are_cut(split: int) -> None:
    net = Net()
    data = bytes(text("in pieces").pack(net.companion.codec))
    for start in range(0, len(data), split):
        net.companion.wire.send(data[start : start + split])
    assert net.read() == ["STATUSTEXT"]


def test_garbage_between_frames_is_counted_and_dropped() -> None:
    net = Net()
    net.companion.wire.send(bytes(range(32)) + b"\x00" * 50)
    net.companion.send(text("after"))
    assert net.read() == ["STATUSTEXT"]
    assert net.companion.wire.peers[0].bad > 0
    assert [m.text for m in net.station.heard()] == ["after"]


def test_a_frame_with_a_wrong_checksum_is_delivered_to_nobody() -> None:
    net = Net()
    spoilt = bytearray(text("spoilt").pack(net.companion.codec))
    spoilt[-1] ^= 0xFF
    net.companion.wire.send(bytes(spoilt))
    net.companion.send(text("whole"))
    net.read()
    assert [m.text for m in net.delivered] == ["whole"]


def test_the_autopilots_own_words_come_back_to_nobody() -> None:
    net = Net()
    echo = Station(1, 1)
    net.companion.wire.send(bytes(text("echo").pack(echo.codec)))
    assert net.read() == []
    assert (net.station.kinds(), net.other.kinds()) == ([], [])


@pytest.mark.parametrize("stuck", [False, True])
def test_a_parser_that_fails_on_one_frame_loses_that_frame_alone(
    stuck: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    net = Net()
    codec = net.companion.wire.peers[0].codec
    whole = codec.decode

    def decode(frame: Any) -> Any:
        if b"evil" in bytes(frame):
            raise KeyError("evil")
        return whole(frame)

    def parse_char(_data: Any) -> Any:
        raise KeyError("always")

    monkeypatch.setattr(codec, "decode", decode)
    if stuck:
        monkeypatch.setattr(codec, "parse_char", parse_char)
    for word in ("before", "evil", "after"):
        net.companion.wire.send(bytes(text(word).pack(net.companion.codec)))
    net.read()
    assert [m.text for m in net.delivered] == ([] if stuck else ["before", "after"])
    assert net.companion.wire.peers[0].bad >= 1


# ---- the link model ------------------------------------------------------------------------------------


def test_a_delay_holds_messages_back_on_simulated_time_both_ways() -> None:
    net = Net()
    net.router.model = LinkModel(delay_s=0.1)
    net.companion.send(text())
    net.router.send(None, text())
    assert net.read(0) == []
    assert net.read(99_999_999) == []
    assert net.station.kinds() == []
    assert net.read(100_000_000) == ["STATUSTEXT"]
    assert "STATUSTEXT" in net.station.kinds()


def test_a_cut_link_carries_nothing_either_way() -> None:
    net = Net()
    net.router.model = LinkModel(cut=True)
    net.companion.send(text())
    net.router.send(None, text())
    assert net.read() == []
    assert net.companion.kinds() == net.station.kinds() == []


@pytest.mark.parametrize(("model", "low", "high"), [
    (LinkModel(loss=0.3), 620, 780),
    (LinkModel(duplicate=0.3), 1220, 1380),
    (LinkModel(jitter_s=0.05), 1000, 1000),
    (LinkModel(), 1000, 1000),
])  # fmt: skip
def test_loss_and_duplication_have_the_rates_asked_for(model: LinkModel, low: int, high: int) -> None:
    net = Net()
    net.router.model = model
    for _ in range(1000):
        net.companion.send(text())
    net.read(1)
    net.read(LATE_NS)
    assert low <= len(net.delivered) <= high


def test_corruption_spoils_frames_and_the_receiver_sees_fewer_of_them() -> None:
    net = Net()
    net.router.model = LinkModel(corrupt=0.5)
    for _ in range(400):
        net.router.send(None, text("x" * 40))
    kinds = net.companion.kinds()
    assert 120 < kinds.count("STATUSTEXT") < 280
    assert "BAD_DATA" in kinds
    for _ in range(400):
        net.companion.send(text("x" * 40))
    net.read()
    assert 120 < len(net.delivered) < 280


def test_the_same_seed_loses_the_same_messages() -> None:
    def run(seed: int) -> list[str]:
        net = Net(seed)
        net.router.model = LinkModel(loss=0.5)
        for number in range(50):
            net.companion.send(text(str(number)))
        net.read()
        return [m.text for m in net.delivered]

    assert run(3) == run(3)
    assert run(3) != run(4)
