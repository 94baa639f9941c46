"""LiDAR packets of a network capture, as the points of a telemetry log."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

from companion.desk.replay.captures.pcap import Capture, Datagram
from companion.desk.replay.foreign_replay import Act, Rerun
from companion.desk.replay.recorder_clock import ClockStep, continuous_time
from companion.flight.sensors.lidar_url import read_metadata
from companion.flight.sensors.packet_identification import identify_packet, is_points
from companion.flight.sensors.packet_stream import PacketStream
from companion.flight.sensors.sensor_registry import decoder_for
from companion.flight.sensors.udp_lidar import BATCH_PACKETS
from companion.flight.sensors.undecoded_lidars import WAY, undecoded_lidar
from companion.runtime.errors import UsageError

LOOKED_AT = 2000  # packets of LiDARs examined to identify the sensor
BATCH_NS = 10_000_000


class CapturedPackets:
    """Packets of FILE.pcap; see `LoggedPoints`.

    Parameters
    ----------
    lidar
        Kind of the sensor as in its URL, `ouster?meta=FILE` with its metadata; None: identified from its
        packets.

    Raises
    ------
    UsageError
        The file cannot be used, or the sensor is unknown.
    """

    def __init__(self, path: Path, lidar: str | None) -> None:
        self._capture = Capture(path)
        self._kind_told = ""
        self._stream: PacketStream | None = None
        kind, _, query = self._kind(path, lidar).partition("?")
        self._kind_told = kind
        try:
            self._metadata = read_metadata(kind, query)
        except UsageError as error:
            raise UsageError(f"--lidar {lidar}: {error}") from None
        decoder_for(kind, self._metadata)

    @property
    def cut(self) -> str:
        return self._capture.cut

    @property
    def bad(self) -> int:
        return self._capture.bad

    def summary(self) -> dict[str, Any]:
        packets = {} if self._stream is None else self._stream.statistics()
        capture = self._capture
        return {
            "lidar": self._kind_told,
            "packets": packets,
            "no_udp": capture.other,
            "not_read": capture.not_read,
            "unreadable": capture.bad,
            "snapped": capture.snapped,
            "snapped_bytes": capture.snapped_bytes,
        }

    def steps(self, rerun: Rerun, clock_steps: Sequence[ClockStep]) -> Iterator[tuple[int, Act]]:
        decoder = decoder_for(self._kind_told, self._metadata)
        stream = self._stream = PacketStream(decoder, rerun.parameters, rerun.add_returns, lambda: 0)
        stream.on_imu.subscribe(rerun.on_imu.emit)
        rerun.diagnosis = stream.diagnosis
        rerun.diagnosis.placed = rerun.assembler
        see = _BatchDecoder(stream)
        recorded = continuous_time(clock_steps, (one.at_ns for one in self._capture.datagrams()))
        at_ns = 0
        for datagram in self._capture.datagrams():
            at_ns = recorded(datagram.at_ns)
            yield at_ns, partial(see, replace(datagram, at_ns=at_ns))
        yield at_ns, partial(stream.flush, at_ns)

    def _kind(self, path: Path, lidar: str | None) -> str:
        """Return the kind of sensor: that of the user, else the most frequent one among the first packets."""
        kinds, undecoded, n_udp = Counter[str](), Counter[str](), 0
        for datagram in self._capture.datagrams():
            n_udp += 1
            name = undecoded_lidar(datagram.data)
            kind = None if name is not None else identify_packet(datagram.data)
            if name is not None:
                undecoded[name] += 1
            elif kind is not None and is_points(datagram.data, kind):
                kinds[kind] += 1
            if kinds.total() + undecoded.total() >= LOOKED_AT:
                break
        if lidar is not None and (not undecoded or lidar.partition("?")[0] in kinds):
            return lidar
        if lidar is None and kinds:
            return str(kinds.most_common(1)[0][0])
        if undecoded:
            names = " and ".join(sorted(undecoded))
            raise UsageError(
                f"{path}: its packets are those of {names}, for which there is no decoder, so that --lidar"
                f" cannot help: {WAY}"
            )
        snapped = snapped_packets(self.summary())
        if snapped:
            raise UsageError(f"{path}: no UDP packet of it is whole: {'; '.join(snapped)}")
        what = f"none of its {n_udp} UDP packets is of a known LiDAR: name it by --lidar"
        if not n_udp:
            what = "it holds no UDP packet that has a time"
        raise UsageError("; ".join(filter(None, [f"{path}: {what}", *self._capture.not_read, self.cut])))


def snapped_packets(source: Mapping[str, Any]) -> list[str]:
    """Return a sentence on packets cut by the capture's snap length, from the summary of a source."""
    count, kept = source.get("snapped", 0), source.get("snapped_bytes", 0)
    if not count:
        return []
    return [f"{count} packets were cut to {kept} bytes when captured: capture whole ones (tcpdump -s 0)"]


class _BatchDecoder:
    """Decoder of captured packets in batches, as in the driver."""

    def __init__(self, stream: PacketStream) -> None:
        self._stream = stream
        self._flushed_ns = 0

    def __call__(self, datagram: Datagram) -> None:
        self._stream.add_packet(datagram.data, datagram.host, datagram.at_ns)
        if len(self._stream) >= BATCH_PACKETS or datagram.at_ns - self._flushed_ns >= BATCH_NS:
            self._stream.flush(datagram.at_ns)
            self._flushed_ns = datagram.at_ns
