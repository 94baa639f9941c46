"""Decoder of a flash LiDAR's datagrams (`docs/instruments.md`): one row of a frame each, with settings."""

from __future__ import annotations

import struct
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from companion.flight.sensors.returns import RawReturns, join_raw, nothing
from slz.flash.camera import FlashCamera, FlashFrame
from slz.flash.frame_processing import process_frame, sensor_pixels

MAGIC = b"SLZF"
VERSION = 1
HEADER = struct.Struct("<4sBBHHHHIQfffffHHI")
MOST_NS = 2**62
MOST_SIDE = 1024
NEAREST_M = 0.5
FARTHEST_M = 3_000.0
FULL_SCALE = 4095.0


@dataclass(slots=True)
class FlashCounters:
    """Counters of received and dropped data; frames that lack a row are used, its pixels being unknown."""

    packets: int = 0
    malformed: int = 0
    lost_packets: int = 0
    frames: int = 0
    unusable_frames: int = 0
    returns: int = 0
    no_return: int = 0


class FlashDecoder:
    """Decoder that assembles rows to frames, and converts a frame when it is complete or the next begins."""

    kind: ClassVar[str] = "flash"
    metadata: ClassVar[str] = ""

    def __init__(self) -> None:
        self.counters = FlashCounters()
        self._packets = 0
        self._camera: FlashCamera | None = None
        self._frame = -1
        self._stamp_ns = 0
        self._rows_left = 0
        self._samples: NDArray[np.uint16] = np.empty((0, 0, 0), np.uint16)
        self._counter: NDArray[np.uint32] = np.empty((0, 0), np.uint32)
        self._done: list[RawReturns] = []

    def __len__(self) -> int:
        """Return the number of packets since the last `drain`."""
        return self._packets

    def check(self, packet: bytes) -> int | None:
        """Return the time of the flash (ns), or None, counted as malformed, if it is no row of a frame."""
        head = _header(packet)
        if head is None:
            self.counters.malformed += 1
            return None
        return head.stamp_ns

    def add_packet(self, packet: bytes) -> None:
        """Store a row."""
        head = _header(packet)
        if head is None:
            return
        self._packets += 1
        self.counters.packets += 1
        if head.frame != self._frame or head.camera != self._camera:
            self._finish()
            self._begin(head)
        n = head.camera.cols
        body = packet[HEADER.size :]
        self._counter[head.row] = np.frombuffer(body, "<u4", n)
        self._samples[head.row] = np.frombuffer(body, "<u2", offset=4 * n).reshape(n, -1)
        self._rows_left -= 1
        if self._rows_left == 0:
            self._finish()

    def drain(self) -> RawReturns:
        """Return the points of the finished frames."""
        self._packets = 0
        done, self._done = self._done, []
        return join_raw(done) if done else nothing()

    def _begin(self, head: _Head) -> None:
        camera = head.camera
        self._camera, self._frame, self._stamp_ns = camera, head.frame, head.stamp_ns
        self._rows_left = camera.rows
        self._samples = np.zeros((camera.rows, camera.cols, camera.n_samples), np.uint16)
        self._counter = np.full((camera.rows, camera.cols), camera.gate_counter, np.uint32)

    def _finish(self) -> None:
        camera, self._frame = self._camera, -1
        if camera is None or not self._counter.size:
            return
        self.counters.lost_packets += max(0, self._rows_left)
        self.counters.frames += 1
        image = process_frame(FlashFrame(self._samples, self._counter, self._stamp_ns), camera)
        self._counter = np.empty((0, 0), np.uint32)
        points, _, pixels = sensor_pixels(image, camera, filtered=False)
        self.counters.unusable_frames += not image.triage.usable
        self.counters.returns += len(points)
        self.counters.no_return += image.filtered_m.size - len(points)
        if not len(points):
            return
        share = image.measured.intensity[pixels] / (FULL_SCALE - camera.baseline_counts)
        none, one = np.zeros(len(points), np.uint8), np.ones(len(points), np.uint8)
        self._done.append(
            RawReturns(
                points.astype(np.float32),
                np.full(len(points), image.stamp_ns, np.int64),
                np.clip(np.rint(255 * share), 1, 255).astype(np.uint8),
                none,
                one,
                one,
                has_thin_rays=False,
            )
        )


@dataclass(frozen=True, slots=True)
class _Head:
    camera: FlashCamera
    row: int
    frame: int
    stamp_ns: int


def _header(packet: bytes) -> _Head | None:
    """Return the header of a datagram, None if it is invalid or not a flash LiDAR's."""
    if len(packet) < HEADER.size or packet[:4] != MAGIC or packet[4] != VERSION:
        return None
    _, _, _, rows, cols, n, row, frame, stamp, fov, tick, pulse, dark, noise, full, marker, gate = (
        HEADER.unpack_from(packet)
    )
    if not (row < rows <= MOST_SIDE and cols <= MOST_SIDE and stamp < MOST_NS):
        return None
    if len(packet) != HEADER.size + cols * (4 + 2 * n):
        return None
    try:
        camera = FlashCamera(
            rows, cols, fov, n, tick, pulse, dark, noise, full, marker, gate, NEAREST_M, FARTHEST_M
        )
    except ValueError:
        return None
    return _Head(camera, row, frame, stamp)
