"""Conversion of one LiDAR's packets to batches of returns on the companion's clock; without I/O."""

from __future__ import annotations

import logging
from collections import deque
from collections.abc import Callable
from dataclasses import asdict
from typing import Any, Protocol, runtime_checkable

from companion.flight.sensors.device_clock import SensorClock
from companion.flight.sensors.diagnosis.lidar_diagnosis import LidarDiagnosis
from companion.flight.sensors.diagnosis.packet_signs import HasSigns
from companion.flight.sensors.imu_samples import ImuSamples
from companion.flight.sensors.packet_identification import NAMES, identify_packet, is_points
from companion.flight.sensors.returns import RawReturns, Returns, join_raw
from companion.flight.sensors.synchronised_clock import SynchronisedClock
from companion.flight.sensors.undecoded_lidars import WAY, undecoded_lidar
from companion.runtime.clock import WallOffset
from companion.runtime.event import Event
from params import Parameters

log = logging.getLogger(__name__)

RATE_NS = 1_000_000_000
PAUSE_NS = 300_000_000
REMEMBERED = 64  # number of packets searched for a duplicate
REMEMBERED_IMU = 16
IMU_LATE_NS, IMU_EARLY_NS = 500_000_000, 50_000_000  # of an inertial sample against its arrival
UNDIAGNOSED = frozenset({"ros2"})
NEAR_NS = 1_000_000_000
MOST_UNANSWERED = 100  # batches without any return whose lost rays wait for the next one

OnReturns = Callable[[Returns], None]
Batch = list[tuple[int, bytes]]  # arrival and packet


class Decoder(Protocol):
    """Interface of a sensor's packet decoder."""

    counters: Any
    """Dataclass of counters of received and dropped data."""

    @property
    def kind(self) -> str:
        """Kind of sensor, as in its URL."""

    @property
    def metadata(self) -> str:
        """Metadata that decoding needs besides the packets, or empty."""

    def check(self, packet: bytes) -> int | None:
        """Return the sensor's time of a packet's last point (ns), or None, counted, if it is invalid."""

    def add_packet(self, packet: bytes) -> None:
        """Store a packet accepted by `check`."""

    def drain(self) -> RawReturns:
        """Decode the stored packets."""

    def __len__(self) -> int:
        """Return the number of stored packets."""


@runtime_checkable
class ImuDecoder(Protocol):
    """Decoder of a sensor with an inertial measurement unit."""

    def is_imu(self, packet: bytes) -> bool:
        """Return whether a packet claims to hold inertial samples; called for everything that arrives."""

    def decode_imu(self, packet: bytes) -> ImuSamples | None:
        """Return the samples of such a packet on the sensor's clock; None, counted, if it is invalid."""


class PacketStream:
    """Checks, time stamps and decoding of one sensor's packets.

    It uses one sensor, the `named` one if given. Another host's packets are counted as foreign until the
    first has been silent for `lidar_timeout_s`, because two sensors' clocks and counters would mix. A
    duplicated packet is used once. Packets of another maker are counted, and the first is logged; so are
    packets at which the decoder fails. If it fails at all of them, the sensor counts as silent.

    Inertial samples of an `ImuDecoder` go out with the batch in which they arrived, before its returns. The
    points alone decide whose packets are used, the mapping of the clock and whether the sensor is silent.
    Samples before the first points are dropped and counted as undated, and so are those that this mapping
    places more than 0.5 s before their arrival or 50 ms after it.

    Parameters
    ----------
    decoder
        Decoder of this kind of sensor.
    parameters
        `lidar_clock`, `lidar_delay_ms` and `lidar_timeout_s`.
    wall_offset_ns
        Returns the offset of UTC from the companion's clock; for a sensor synchronised by PTP or GPS.
    on_returns
        Called with every batch.

    Attributes
    ----------
    batches
        Event of the packets of a batch, before it is decoded.
    on_imu
        Event of inertial samples, mapped to the companion's clock.
    last_arrival_ns
        Arrival of the newest valid packet of points; None before any.
    diagnosis
        Diagnosis of stream and clock.
    """

    def __init__(
        self,
        decoder: Decoder,
        parameters: Parameters,
        on_returns: OnReturns,
        wall_offset_ns: Callable[[], int] | None = None,
        named: str | None = None,
    ) -> None:
        self._decoder = decoder
        self._imu = decoder if isinstance(decoder, ImuDecoder) else None
        self._on_returns = on_returns
        delay_ns = round(parameters.lidar_delay_ms * 1e6)
        self._clock: SensorClock | SynchronisedClock = SensorClock(delay_ns)
        if parameters.lidar_clock != "free":
            self._clock = SynchronisedClock(wall_offset_ns or WallOffset(), delay_ns)
        self._patience_ns = round(parameters.lidar_timeout_s * 1e9)
        self._named = named
        self._host: str | None = None
        self._foreign = 0
        self._repeated = 0
        self._wrong_sensor = 0
        self._failed = 0
        self._decoded_ns: int | None = None
        self._newest_ns: int | None = None  # stamp, on the sensor's clock
        self._recent, self._recent_imu = _Recent(REMEMBERED), _Recent(REMEMBERED_IMU)
        self._undated = 0
        self._kept: Batch = []
        self._samples: list[tuple[int, ImuSamples]] = []
        self._unanswered: deque[RawReturns] = deque(maxlen=MOST_UNANSWERED)
        self._rate = _Rate()
        self.batches: Event[[Batch]] = Event()
        self.on_imu: Event[[ImuSamples]] = Event()
        self.last_arrival_ns: int | None = None
        signs = decoder.signs if isinstance(decoder, HasSigns) else None
        self.diagnosis = LidarDiagnosis(parameters.lidar_clock, signs, self._clock, self.statistics)

    @property
    def kind(self) -> str:
        """Kind of sensor, as in its URL."""
        return self._decoder.kind

    @property
    def metadata(self) -> str:
        """Metadata that decoding needs besides the packets."""
        return self._decoder.metadata

    @property
    def is_diagnosed(self) -> bool:
        """True if `diagnosis` holds: a ROS cloud's arrival and stamp depend on the driver that made it."""
        return self.kind not in UNDIAGNOSED

    def __len__(self) -> int:
        """Return the number of packets waiting to be decoded."""
        return len(self._kept)

    def add_packet(self, packet: bytes, host: str, arrival_ns: int) -> None:
        """Store a packet for the next batch; an invalid one is counted and dropped."""
        try:
            if self._imu is not None and self._imu.is_imu(packet):
                self._add_imu(self._imu.decode_imu(packet), packet, host, arrival_ns)
                return
            stamp_ns = self._decoder.check(packet)
        except Exception:
            self._fail([(arrival_ns, packet)])
            return
        if stamp_ns is None:
            self._suspect(packet, host)
            self.diagnosis.check(arrival_ns)
            return
        if host != self._host and not self._takes_over(host, arrival_ns):
            self._foreign += 1
            return
        if self._recent.holds(stamp_ns, packet):
            self._repeated += 1
            return
        if self._clock.is_jump(stamp_ns, arrival_ns):
            self.flush(arrival_ns)  # the earlier packets belong to the clock before its jump
        self._clock.observe(stamp_ns, arrival_ns)
        self._newest_ns = stamp_ns
        try:
            self._decoder.add_packet(packet)
        except Exception:
            self._fail([(arrival_ns, packet)])
            return
        last_ns = self.last_arrival_ns
        if not self._kept or last_ns is None or arrival_ns - last_ns > PAUSE_NS:
            self.diagnosis.note_packet(stamp_ns, arrival_ns)
        self._kept.append((arrival_ns, packet))
        self.last_arrival_ns = arrival_ns

    def flush(self, now_ns: int) -> None:
        """Decode the stored packets and pass the returns on."""
        if not self._kept:
            return
        kept, self._kept = self._kept, []
        self.batches.emit(kept)
        self._pass_samples()
        if len(self._decoder):
            self._decode(kept, now_ns)

    def _decode(self, kept: Batch, now_ns: int) -> None:
        """Decode the stored packets of points, those of a batch, and pass the returns on."""
        newest_ns = self.last_arrival_ns
        try:
            raw = self._decoder.drain()
        except Exception:
            self._fail([(at_ns, packet) for at_ns, packet in kept if not self._is_imu(packet)])
            return
        self._decoded_ns = newest_ns
        self.diagnosis.add_returns(raw)
        if newest_ns is not None:
            self.diagnosis.check(newest_ns)
        if not len(raw):
            if len(raw.lost_ns):  # as over water: they go with the next batch that has a return
                self._unanswered.append(raw)
            return
        self._rate.add(now_ns, len(raw))
        if self._unanswered:
            raw = join_raw([*self._unanswered, raw])
            self._unanswered.clear()
        self._on_returns(raw.shifted(self._clock.offset_ns(int(raw.stamp_ns[-1]))))

    def offset_ns(self, stamp_ns: int) -> int | None:
        """Return the offset from the sensor's clock to the companion's at a stamp near the newest packet's.

        None before any packet, and for a stamp a second or more away, which is of another clock.
        """
        newest_ns = self._newest_ns
        if newest_ns is None or abs(stamp_ns - newest_ns) >= NEAR_NS:
            return None
        return self._clock.offset_ns(stamp_ns)

    def statistics(self) -> dict[str, int | float | None]:
        """Return counters of packets and returns, and of dropped data by reason."""
        return asdict(self._decoder.counters) | {
            "foreign": self._foreign,
            "repeated": self._repeated,
            "wrong_sensor": self._wrong_sensor,
            "failed": self._failed,
            "imu_undated": self._undated,
            "clock_resets": self._clock.resets,
            "clock_follows": getattr(self._clock, "keeps", None),
            "last_arrival_ns": self.last_arrival_ns,
            "rate_hz": self._rate.hz,
        }

    def _add_imu(self, samples: ImuSamples | None, packet: bytes, host: str, arrival_ns: int) -> None:
        """Store the samples of the sensor whose points are used, None if its packet was invalid."""
        if samples is None:
            self._suspect(packet, host)
            return
        if self._host is None:
            self._undated += 1
            return
        if host != self._host:
            self._foreign += 1
            return
        if self._recent_imu.holds(int(samples.stamp_ns[-1]), packet):
            self._repeated += 1
            return
        self._kept.append((arrival_ns, packet))
        self._samples.append((arrival_ns, samples))

    def _pass_samples(self) -> None:
        """Map the stored samples to the companion's clock and pass them on."""
        waiting, self._samples = self._samples, []
        for arrival_ns, samples in waiting:
            newest_ns = int(samples.stamp_ns[-1])
            mapped = samples.shifted(self._clock.offset_ns(newest_ns))
            if -IMU_EARLY_NS <= arrival_ns - int(mapped.stamp_ns[-1]) <= IMU_LATE_NS:
                self.on_imu.emit(mapped)
            else:
                self._undated += 1

    def _is_imu(self, packet: bytes) -> bool:
        return self._imu is not None and self._imu.is_imu(packet)

    def _fail(self, lost: Batch) -> None:
        """Count packets at which the decoder fails as not received; log the first with its traceback."""
        if not self._failed:
            log.exception("the decoder of %s fails; the packet began %s", self.kind, lost[0][1][:64].hex())
        self._failed += len(lost)
        self.last_arrival_ns = self._decoded_ns

    def _takes_over(self, host: str, arrival_ns: int) -> bool:
        """Return whether a host other than the present one takes its place: that has been silent."""
        silent = self.last_arrival_ns is None or arrival_ns - self.last_arrival_ns > self._patience_ns
        if not silent or host != (self._named or host):
            return False
        log.info("LiDAR at %s", host)
        self._host = host
        return True

    def _suspect(self, packet: bytes, host: str) -> None:
        """Log once that another maker's sensor sends to this port."""
        found = identify_packet(packet)
        undecoded = undecoded_lidar(packet)
        if undecoded is not None:
            self._suspect_undecoded(undecoded, host)
        if found == self.kind:
            self._suspect_own(packet)
            return
        if undecoded is not None:
            self._wrong_sensor += 1
            return
        if found is None:
            return
        if not self._wrong_sensor:
            log.error(
                "packets from %s look like those of %s, not of %s: is %s: meant in the LiDAR's URL?",
                *(host, NAMES[found], NAMES.get(self.kind, self.kind), found),
            )
        self._wrong_sensor += 1

    def _suspect_undecoded(self, name: str, host: str) -> None:
        """Log once that a LiDAR without a decoder sends to this port, and let the diagnosis name it."""
        if not self.diagnosis.undecoded:
            log.error("packets from %s are those of %s, which has no decoder: %s", host, name, WAY)
        self.diagnosis.undecoded = name

    def _suspect_own(self, packet: bytes) -> None:
        """Report points of this maker that the decoder cannot use to the diagnosis."""
        if not self._is_imu(packet) and is_points(packet, self.kind):
            self.diagnosis.note_unfit()


class _Recent:
    """The newest packets with their stamps; one with a later stamp than all of them is none of them."""

    def __init__(self, most: int) -> None:
        self._packets: deque[tuple[int, bytes]] = deque(maxlen=most)
        self._newest_ns = -1

    def holds(self, stamp_ns: int, packet: bytes) -> bool:
        """Return whether a packet is one of them, or else remember it in place of the oldest."""
        one = stamp_ns, packet
        if stamp_ns > self._newest_ns:
            self._newest_ns = stamp_ns
            self._packets.append(one)
            return False
        if one in self._packets:
            return True
        self._packets.append(one)
        self._newest_ns = max(stamp_ns for stamp_ns, _ in self._packets)
        return False


class _Rate:
    """Rate of returns, over the last whole second with any."""

    def __init__(self) -> None:
        self.hz = 0.0
        self._since_ns: int | None = None
        self._count = 0

    def add(self, now_ns: int, count: int) -> None:
        if self._since_ns is None:
            self._since_ns = now_ns
        elapsed_ns = now_ns - self._since_ns
        if elapsed_ns >= RATE_NS:
            self.hz = self._count * 1e9 / elapsed_ns
            self._since_ns, self._count = now_ns, 0
        self._count += count
