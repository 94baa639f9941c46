"""Decoder of Ouster's OS0, OS1 and OS2 (firmware manual, lidar data packet format).

The sensor's metadata define the packet: rows, columns, profile, angles of the beams. Each column has a stamp
(ns), its number in the frame, and a status whose lowest bit means valid. Points are in the sensor frame of
the manual: x forward, away from the connector, y left, z up.

The optional package `ouster-sdk` reads packets and metadata.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from importlib import import_module
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from companion.flight.sensors.decoders.ouster_imu import OusterImu
from companion.flight.sensors.decoders.ouster_points import place_pixels
from companion.flight.sensors.diagnosis.packet_signs import PacketSigns
from companion.flight.sensors.imu_samples import ImuSamples
from companion.flight.sensors.returns import RawReturns, nothing, thinning
from companion.runtime import extras
from companion.runtime.errors import UsageError

READER = "LiDAR ouster: reads packets with ouster-sdk, which"
LEGACY = "LEGACY"
LIDAR_TYPE = 1
MOST_FPS = 20
MOST_NS = 2**62
MOST_PACKET_NS = 50_000_000  # no packet takes longer; at 5 Hz and 512 columns a frame it takes 6 ms
MOST_ROWS, MOST_COLUMNS = 512, 16_384  # limits of a frame; the largest sensors have 128 and 4096
MOST_M = 10.0  # limit for a point at 1 m
PAUSE_FRAMES = 10  # a longer gap means a sensor that was off, not lost packets
Bytes = NDArray[np.uint8]
NEAR_M = 0.35  # below the least range of the data sheet: the window
WHITE = 100.0  # calibrated reflectivity of a target that scatters all light; more is retro-reflective


@dataclass(slots=True)
class OusterCounters:
    """Counters of received and dropped data; `empty` packets hold no valid column."""

    packets: int = 0
    imu: int = 0
    empty: int = 0
    malformed: int = 0
    lost_packets: int = 0
    returns: int = 0
    no_return: int = 0


@dataclass(frozen=True, slots=True)
class _Columns:
    """Stamps (ns), numbers in the frame and validity of a packet's columns, each (columns,)."""

    stamp_ns: NDArray[np.int64]
    number: NDArray[np.int64]
    valid: NDArray[np.bool_]


class _Format:
    """Packet format given by the metadata, read with ouster-sdk.

    direction, offset_m: (columns of a frame, rows, 3); a point is offset + range * direction. thinning: every
    k-th pixel without a return is passed on.
    """

    def __init__(self, metadata: str) -> None:
        try:
            sdk = import_module("ouster.sdk.core")
        except ModuleNotFoundError:
            raise UsageError(extras.explain("LiDAR ouster", "ouster-sdk", "ouster")) from None
        except ImportError as error:  # a missing system library that the package needs, such as OpenGL's
            library = str(error).partition(":")[0]
            hint = " (Debian: sudo apt install libgl1)" if library.startswith("libGL.") else ""
            raise UsageError(f"{READER} cannot be loaded without {library}{hint}") from None
        try:
            info = sdk.SensorInfo(metadata)
            _check_size(info.format)
            self._packet = sdk.PacketFormat(info)
            project = sdk.XYZLut(info)
        except (RuntimeError, ValueError) as error:
            line = " ".join(str(error).split())
            raise UsageError(f"LiDAR ouster: its metadata cannot be read: {line}") from None
        self._header = sdk.ColHeader
        self.rows, self.frame_columns = int(info.format.pixels_per_column), int(info.format.columns_per_frame)
        self.size = int(self._packet.lidar_packet_size)
        self.imu = OusterImu(int(self._packet.imu_packet_size), info.imu_to_sensor_transform)
        self.thinning = thinning(self.rows * self.frame_columns * (int(info.format.fps) or MOST_FPS))
        self.frames = int(self._packet.max_frame_id) + 1
        self._is_legacy = info.format.udp_profile_lidar.name == LEGACY
        names = set(self._packet.fields)
        self._echoes = [("RANGE", "REFLECTIVITY")]
        if "RANGE2" in names:
            self._echoes.append(("RANGE2", "REFLECTIVITY2"))
        near, far = (project(np.full((self.rows, self.frame_columns), mm, np.uint32)) for mm in (1000, 2000))
        with np.errstate(all="ignore"):
            self.direction = _by_column(far - near)
            self.offset_m = _by_column(2 * near - far)
        if not (np.abs(self.direction) < MOST_M).all() or not (np.abs(self.offset_m) < MOST_M).all():
            raise UsageError("LiDAR ouster: its metadata places points nowhere: fetch it again")
        columns = int(self._packet.columns_per_packet)
        first, last = (int(column) for column in info.format.column_window)
        window = np.arange(first, last + 1 if last >= first else last + 1 + self.frame_columns)
        slots = dict.fromkeys(window % self.frame_columns // columns)
        self._slots = {int(n): i for i, n in enumerate(slots)}
        self._columns = columns
        self.packet_ns = columns * 1_000_000_000 // (self.frame_columns * (int(info.format.fps) or MOST_FPS))
        self.azimuth_deg = 360.0 * first / self.frame_columns, 360.0 * columns / self.frame_columns
        config = info.config
        self.destination = str(config.udp_dest or "") if config is not None else ""

    def columns(self, data: Bytes) -> _Columns | None:
        """Return a packet's columns, None if a sensor with this metadata cannot have sent them."""
        if not self._is_legacy and self._packet.packet_type(data) != LIDAR_TYPE:
            return None
        number = self._packet.packet_header(self._header.MEASUREMENT_ID, data).astype(np.int64)
        valid = (self._packet.packet_header(self._header.STATUS, data) & 1).astype(bool)
        stamp = self._packet.packet_header(self._header.TIMESTAMP, data)[valid]
        if (number[valid] >= self.frame_columns).any() or (stamp > MOST_NS).any():
            return None
        stamp_ns = stamp.astype(np.int64)
        if len(stamp_ns) and not (
            (np.diff(stamp_ns) >= 0).all() and stamp_ns[-1] - stamp_ns[0] < MOST_PACKET_NS
        ):
            return None
        return _Columns(stamp_ns, number[valid], valid)

    def place(self, data: Bytes) -> int | None:
        """Return a packet's index among all packets of the sensor; it wraps after `frames` frames."""
        column = int(self._packet.packet_header(self._header.MEASUREMENT_ID, data)[0])
        slot = self._slots.get(column // self._columns)
        return None if slot is None else int(self._packet.frame_id(data)) * len(self._slots) + slot

    @property
    def frame_packets(self) -> int:
        """Number of packets per frame."""
        return len(self._slots)

    def measurements(self, data: Bytes, valid: NDArray[np.bool_]) -> tuple[NDArray[np.uint32], Bytes]:
        """Return ranges (mm) and reflectivities, each (columns, rows, echoes)."""
        field = self._packet.packet_field
        range_mm = np.stack([field(name, data).T[valid] for name, _ in self._echoes], -1)
        bright = np.stack([field(name, data).T[valid] for _, name in self._echoes], -1)
        return range_mm.astype(np.uint32, copy=False), np.minimum(bright, 255).astype(np.uint8)


def _check_size(form: Any) -> None:
    """Refuse metadata of an impossible sensor before memory is allocated."""
    rows, columns = int(form.pixels_per_column), int(form.columns_per_frame)
    packet = int(form.columns_per_packet)
    if not (0 < rows <= MOST_ROWS and 0 < columns <= MOST_COLUMNS and 0 < packet <= columns):
        layout = f"{rows} rows, {columns} columns, {packet} of them in a packet"
        raise UsageError(f"LiDAR ouster: its metadata tells of {layout}: fetch it again from the sensor")


def _by_column(rows_columns: NDArray[np.float64]) -> NDArray[np.float32]:
    return np.ascontiguousarray(rows_columns.transpose(1, 0, 2), np.float32)


_format_of = lru_cache(maxsize=4)(_Format)


@dataclass(slots=True)
class OusterDecoder:
    """Decoder that stores packets and decodes them together; malformed ones are counted, never raised.

    Parameters
    ----------
    metadata
        The sensor's metadata, JSON.

    Raises
    ------
    UsageError
        The metadata cannot be read, or ouster-sdk is not installed.
    """

    kind: ClassVar[str] = "ouster"

    metadata: str
    counters: OusterCounters = field(default_factory=OusterCounters)
    _packets: list[bytes] = field(default_factory=list)
    signs: PacketSigns = field(init=False)
    _format: _Format = field(init=False)
    _newest: int | None = None

    def __post_init__(self) -> None:
        form = self._format = _format_of(self.metadata)
        self.signs = PacketSigns(
            azimuth_packets=[0] * form.frame_packets,
            azimuth_deg=form.azimuth_deg,
            lines=form.rows,
            near_m=NEAR_M,
            described=True,
            destination=form.destination,
        )

    def __len__(self) -> int:
        """Return the number of packets stored and not decoded yet."""
        return len(self._packets)

    def check(self, packet: bytes) -> int | None:
        """Return the sensor's time of a packet's last point (ns), or None if it is no valid point packet.

        Dropped packets are counted.
        """
        if self.is_imu(packet):
            self.decode_imu(packet)
            return None
        columns = None
        if len(packet) == self._format.size:
            columns = self._format.columns(np.frombuffer(packet, np.uint8))
        if columns is None:
            self.counters.malformed += 1
            return None
        if not len(columns.stamp_ns):
            self.counters.empty += 1
            return None
        return int(columns.stamp_ns[-1])

    def is_imu(self, packet: bytes) -> bool:
        """Return whether a packet has the length of inertial ones."""
        return bool(packet) and len(packet) == self._format.imu.size

    def decode_imu(self, packet: bytes) -> ImuSamples | None:
        """Return the samples of an inertial packet on the sensor's clock; None, counted, if it is invalid."""
        samples = self._format.imu.decode(packet)
        if samples is None:
            self.counters.malformed += 1
            return None
        self.counters.imu += 1
        return samples if len(samples) and self._format.imu.is_placed else None

    def add_packet(self, packet: bytes) -> None:
        """Store a packet accepted by `check`."""
        self.counters.packets += 1
        place = self._format.place(np.frombuffer(packet, np.uint8))
        if place is not None:
            self.signs.azimuth_packets[place % self._format.frame_packets] += 1
        self.signs.covered_ns += self._format.packet_ns
        self._count_lost(place)
        self._packets.append(packet)

    def drain(self) -> RawReturns:
        """Decode the stored packets; pixels without a return are counted, and thinned to `lost`."""
        raw = self._decode(self._packets) if self._packets else nothing()
        self._packets.clear()
        self.counters.returns += len(raw)
        return raw

    def decode(self, packets: Sequence[bytes]) -> RawReturns:
        """Check and decode packets together; without any return the arrays are empty."""
        for packet in packets:
            if self.check(packet) is not None:
                self.add_packet(packet)
        return self.drain()

    def _decode(self, packets: list[bytes]) -> RawReturns:
        form = self._format
        parts = []
        for packet in packets:
            data = np.frombuffer(packet, np.uint8)
            columns = form.columns(data)
            assert columns is not None  # noqa: S101 - `check` has accepted it
            parts.append((columns, *form.measurements(data, columns.valid)))
        range_mm = np.concatenate([part[1] for part in parts])
        bright = np.concatenate([part[2] for part in parts])
        number = np.concatenate([part[0].number for part in parts])
        column_ns = np.concatenate([part[0].stamp_ns for part in parts])
        n = range_mm.size
        xyz, stamp_ns = np.empty((n, 3), np.float32), np.empty(n, np.int64)
        intensity, ring, echo, echoes = np.empty((4, n), np.uint8)
        place = (number, column_ns, form.direction, form.offset_m, form.thinning, self.counters.no_return)
        most_lost = n // form.thinning + 1
        lost, lost_ns = np.empty((most_lost, 3), np.float32), np.empty(most_lost, np.int64)
        kept, absent, n_lost = place_pixels(
            range_mm, bright, *place, xyz, stamp_ns, intensity, ring, echo, echoes, lost, lost_ns
        )
        self.counters.no_return += absent
        return RawReturns(
            *(xyz[:kept], stamp_ns[:kept], intensity[:kept], ring[:kept], echo[:kept], echoes[:kept]),
            lost=lost[:n_lost],
            lost_ns=lost_ns[:n_lost],
            lost_weight=float(form.thinning),
            white=WHITE,
        )

    def _count_lost(self, place: int | None) -> None:
        """Count gaps in the indices of packets, which wrap around."""
        if place is None:
            return
        if self._newest is None:
            self._newest = place
            return
        around = self._format.frames * self._format.frame_packets
        ahead = (place - self._newest) % around
        pause = PAUSE_FRAMES * self._format.frame_packets
        if 0 < ahead < pause:
            self.counters.lost_packets += ahead - 1
        elif around - ahead < pause:
            # Late, and counted as lost when a later one overtook it.
            self.counters.lost_packets = max(0, self.counters.lost_packets - 1)
            return
        self._newest = place
