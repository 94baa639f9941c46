"""Endless streams of recorded packets of a VLP-16 and an OS0-128, and faults injected into them.

The recordings hold 0.4 and 0.1 s, whole turns, and are repeated with new stamps and numbers. Editor and
faults share nothing with those of the simulator, on which the thresholds of the diagnosis were found.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache

import dpkt
import numpy as np
from numpy.typing import NDArray
from rosbags.rosbag2 import Reader
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from companion.flight.sensors.packet_stream import PacketStream
from companion.flight.sensors.sensor_registry import decoder_for
from params import Parameters
from tests.unit.companion.flight.sensors.recordings import recording

HOUR_US = 3_600_000_000
BATCH_NS = 10_000_000
VELODYNE = np.dtype(
    [
        ("blocks", [("flag", "<u2"), ("azimuth", "<u2"), ("rays", [("d", "<u2"), ("i", "u1")], 32)], 12),
        ("us", "<u4"),
        ("factory", "<u2"),
    ]
)
OUSTER_COLUMN = np.dtype(
    [
        ("ns", "<u8"),
        ("number", "<u2"),
        ("status", "<u2"),
        ("pixels", [("d", "<u2"), ("i", "u1"), ("n", "u1")], 128),
    ]
)
OUSTER = np.dtype(
    [("kind", "<u2"), ("frame", "<u2"), ("head", "V28"), ("columns", OUSTER_COLUMN, 16), ("foot", "V32")]
)
TURN = 64  # packets of an Ouster's frame
Record = np.ndarray[tuple[()], np.dtype[np.void]]
Flags = NDArray[np.bool_]


@dataclass(frozen=True, slots=True)
class Recorded:
    """Packets of whole turns, the time from one to the next, and the unit of a range (m)."""

    kind: str
    packets: tuple[Record, ...]
    packet_ns: float
    metadata: str
    unit_m: float

    def packet(self, number: int, stamp_ns: int) -> Record:
        """Return a copy of a packet of the endless stream."""
        one = self.packets[number % len(self.packets)].copy()
        if self.kind == "velodyne":
            one["us"] = stamp_ns // 1000 % HOUR_US
            return one
        one["frame"] = number // TURN % 65_536
        one["columns"]["ns"] = stamp_ns + np.arange(16) * round(self.packet_ns / 16)
        return one

    def azimuth_deg(self, one: Record) -> NDArray[np.float64]:
        """Return the azimuths of blocks or columns, as the sensor turns."""
        if self.kind == "velodyne":
            return -one["blocks"]["azimuth"].astype(np.float64) / 100 % 360
        return (180 - one["columns"]["number"].astype(np.float64) * 360 / 1024) % 360

    def set_ranges(self, one: Record, rays: Flags, range_m: float) -> None:
        """Set the range of rays, (blocks or columns, rays of each); 0 is no return."""
        values = one["blocks"]["rays"] if self.kind == "velodyne" else one["columns"]["pixels"]
        values["d"][rays] = round(range_m / self.unit_m)
        values["i"][rays] = 5 if range_m else 0


@lru_cache(maxsize=2)
def recorded(name: str) -> Recorded:
    """Return the recording of 'vlp16' or 'os0'; skip the test where it is absent."""
    if name == "vlp16":
        types = get_types_from_msg(
            "builtin_interfaces/Time stamp\nuint8[1206] data\n", "velodyne_msgs/msg/VelodynePacket"
        ) | get_types_from_msg(
            "std_msgs/Header header\nvelodyne_msgs/VelodynePacket[] packets\n",
            "velodyne_msgs/msg/VelodyneScan",
        )
        store = get_typestore(Stores.ROS2_HUMBLE)
        store.register(types)
        with Reader(recording("velodyne_vlp16")) as reader:
            scans = [store.deserialize_cdr(raw, c.msgtype) for c, _, raw in reader.messages()]
        data = [np.frombuffer(bytes(p.data), VELODYNE)[0:1].reshape(()) for s in scans for p in s.packets]
        return Recorded("velodyne", tuple(data), 12 * 55_296.0, "", 0.002)  # two returns of each ray
    path = "ouster_os0/OS-0-128-U1_v2.3.0_1024x10"
    with recording(f"{path}.pcap").open("rb") as file:
        frames = [dpkt.ethernet.Ethernet(each).data.data.data for _, each in dpkt.pcap.Reader(file)]
    packets = [np.frombuffer(each, OUSTER).reshape(()) for each in frames if len(each) == OUSTER.itemsize]
    first = next(k for k, one in enumerate(packets) if one["columns"]["number"][0] == 0)
    turned = (*packets[first:], *packets[:first])
    metadata = json.loads(recording(f"{path}.json").read_text())
    return Recorded("ouster", turned, 100e6 / TURN, json.dumps(metadata), 0.008)


Change = Callable[[int, Record], Record | None]
Make = Callable[[np.random.Generator, Recorded, float], Change]


class RecordedBench:
    """Driver's stream that a recording feeds, by a simulated clock.

    Attributes
    ----------
    told
        Seconds and causes, in the order in which they began.
    """

    def __init__(self, name: str, seed: int) -> None:
        self.recorded = recorded(name)
        self.told: list[tuple[float, str]] = []
        self._rng = np.random.default_rng(seed)
        self._seen: set[int] = set()
        self._flushed_ns = self._newest_ns = 0
        self._stream = PacketStream(
            decoder_for(self.recorded.kind, self.recorded.metadata), Parameters(), lambda _: None, lambda: 0
        )

    def feed(self, first_s: float, last_s: float, change: Change | None = None) -> None:
        """Receive the packets between two times, 0.2 ms late and more."""
        packet_ns = self.recorded.packet_ns
        for number in range(round(first_s * 1e9 / packet_ns), round(last_s * 1e9 / packet_ns)):
            at_ns = round((number + 1) * packet_ns) + 200_000 + int(self._rng.exponential(80_000))
            self._newest_ns = max(at_ns, self._newest_ns + 1000)
            one = self.recorded.packet(number, 5_000_000_000 + round(number * packet_ns))
            changed = one if change is None else change(number, one)
            self.wait(self._newest_ns)
            if changed is not None:
                self._stream.add_packet(changed.tobytes(), "10.5.5.1", self._newest_ns)

    def wait(self, now_ns: int) -> None:
        """Let time pass."""
        while self._flushed_ns + BATCH_NS <= now_ns:
            self._flushed_ns += BATCH_NS
            self._stream.flush(self._flushed_ns)
            self._stream.diagnosis.check(self._flushed_ns)
            for episode in self._stream.diagnosis.active:
                if id(episode) not in self._seen:
                    self._seen.add(id(episode))
                    self.told.append((self._flushed_ns * 1e-9, episode.cause))


def lost(rng: np.random.Generator, recorded: Recorded, share: float) -> Change:
    """Return the loss of a share of the packets."""
    return lambda _, one: None if rng.random() < share else one


def halved(rng: np.random.Generator, recorded: Recorded, _: float) -> Change:
    """Return every second frame not sent, and the others numbered without a gap."""

    def change(number: int, one: Record) -> Record | None:
        frame = number // TURN
        one["frame"] = frame // 2 % 65_536
        return None if frame % 2 else one

    return change


def unmeasured(rng: np.random.Generator, recorded: Recorded, width_deg: float) -> Change:
    """Return a sector that the sensor does not measure."""
    begin = float(rng.uniform(0, 360))

    def change(_: int, one: Record) -> Record | None:
        inside = (recorded.azimuth_deg(one) - begin) % 360 < width_deg
        if recorded.kind == "velodyne":
            return None if inside[0] else one
        one["columns"]["status"][inside] = 0
        return one

    return change


def dirty(rng: np.random.Generator, recorded: Recorded, width_deg: float) -> Change:
    """Return a window of whose rays 30 % end in it, and of the others half in nothing."""
    begin = float(rng.uniform(0, 360))

    def change(_: int, one: Record) -> Record:
        inside = (recorded.azimuth_deg(one) - begin) % 360 < width_deg
        rays = one["blocks"]["rays"] if recorded.kind == "velodyne" else one["columns"]["pixels"]
        lot = rng.random(rays.shape)
        recorded.set_ranges(one, inside[:, np.newaxis] & (lot < 0.65), 0.0)
        recorded.set_ranges(one, inside[:, np.newaxis] & (lot < 0.3), float(rng.uniform(0.05, 0.3)))
        return one

    return change


def stepped(rng: np.random.Generator, recorded: Recorded, step_s: float) -> Change:
    """Return a clock that is set."""

    def change(number: int, _: Record) -> Record:
        return recorded.packet(number, 5_000_000_000 + round(number * recorded.packet_ns + step_s * 1e9))

    return change


def silenced(rng: np.random.Generator, recorded: Recorded, pause_s: float) -> Change:
    """Return a pause."""
    first: int | None = None

    def change(number: int, one: Record) -> Record | None:
        nonlocal first
        first = number if first is None else first
        return None if (number - first) * recorded.packet_ns < pause_s * 1e9 else one

    return change
