"""LiDAR packets of a network capture, as the points of a telemetry log."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from functools import partial
from itertools import islice
from pathlib import Path
from typing import Any

from companion.desk.replay.captures.pcap import Capture, Datagram
from companion.desk.replay.foreign_replay import Act, Rerun
from companion.flight.sensors.lidar_url import read_metadata
from companion.flight.sensors.packet_identification import identify_packet
from companion.flight.sensors.packet_stream import PacketStream
from companion.flight.sensors.sensor_registry import decoder_for
from companion.flight.sensors.udp_lidar import BATCH_PACKETS
from companion.runtime.errors import UsageError

LOOKED_AT = 2000  # datagrams examined to identify the sensor
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
        kind, _, query = (lidar or self._kind(path)).partition("?")
        self._kind_told = kind
        try:
            self._metadata = read_metadata(kind, query)
        except UsageError as error:
            raise UsageError(f"--lidar {lidar}: {error}") from None
        decoder_for(kind, self._metadata)
        self._stream: PacketStream | None = None

    @property
    def cut(self) -> str:
        return self._capture.cut

    @property
    def bad(self) -> int:
        return self._capture.bad

    def summary(self) -> dict[str, Any]:
        packets = {} if self._stream is None else self._stream.statistics()
        return {"lidar": self._kind_told, "packets": packets, "no_udp": self._capture.other}

    def steps(self, rerun: Rerun) -> Iterator[tuple[int, Act]]:
        decoder = decoder_for(self._kind_told, self._metadata)
        stream = self._stream = PacketStream(decoder, rerun.parameters, rerun.add_returns, lambda: 0)
        stream.on_imu.subscribe(rerun.on_imu.emit)
        rerun.diagnosis = stream.diagnosis
        rerun.diagnosis.repeated = lambda: rerun.assembler.repeated
        see = _BatchDecoder(stream)
        at_ns = 0
        for datagram in self._capture.datagrams():
            at_ns = datagram.at_ns
            yield at_ns, partial(see, datagram)
        yield at_ns, partial(stream.flush, at_ns)

    def _kind(self, path: Path) -> str:
        """Return the most frequent kind of sensor among the first packets."""
        packets = (datagram.data for datagram in islice(self._capture.datagrams(), LOOKED_AT))
        kinds = Counter(map(identify_packet, packets))
        n_udp = kinds.total()
        del kinds[None]
        if not kinds:
            raise UsageError(
                f"{path}: none of its first {n_udp} UDP packets is of a known LiDAR: name it by --lidar"
            )
        return str(kinds.most_common(1)[0][0])


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
