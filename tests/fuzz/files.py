"""Fuzz harnesses of foreign files: clouds, recordings, captures, logs."""

from __future__ import annotations

import functools
import struct
import tempfile
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
from mcap.writer import Writer

import params
from companion.desk.clouds.cloud import open_source
from companion.desk.clouds.crs import from_option
from companion.desk.replay.captures.pcap import Capture
from companion.desk.replay.recording_reader import RecordingReader
from companion.desk.replay.telemetry_log import TelemetryLog
from companion.flight.recorder import journal
from companion.runtime.errors import UsageError
from params import ParameterError
from tests.fuzz.harness import Harness, Target
from tests.fuzz.wire import mavlink_frames, one_line
from tests.unit.companion.desk.survey import clouds, packing

FEW = np.add([[1.0, 2.0, 3.0], [4.0, 5.0, 6.0], [7.0, 8.0, 9.0], [-1.0, 0.5, 1e3]], (5e5, 4.9e6, 0))
CRS = from_option("EPSG:32610")


def file_target(suffix: str, work: Callable[[Path], object]) -> Callable[[Path], Target]:
    """Try a file; only documented errors of one line may come."""

    def make(folder: Path) -> Target:
        path = folder / f"input{suffix}"

        def target(data: bytes) -> None:
            path.write_bytes(data)
            try:
                work(path)
            except (UsageError, ParameterError) as error:
                one_line(error)

        return target

    return make


def read_cloud(path: Path) -> None:
    """Read all points of a cloud; what is given must be numbers, and no more than was told."""
    source = open_source(path, CRS)
    n = 0
    for chunk in source.chunks():
        n += len(chunk.points)
        if not np.isfinite(chunk.points).all():
            raise AssertionError("points that are no numbers")
    if n > source.n_points:
        raise AssertionError(f"{n} points where {source.n_points} were told")


def read_recording(path: Path) -> None:
    """Read a recording of ours and all that a replay unpacks."""
    for raw in RecordingReader(path).messages():
        try:
            if raw.topic == journal.LIDAR:
                journal.unpack_batch(raw.data)
            elif raw.topic == journal.EVENT:
                journal.unpack_event(raw.data)
        except journal.BadRecordError as error:
            one_line(error)


@functools.cache
def las(suffix: str = ".las") -> Sequence[bytes]:
    with tempfile.TemporaryDirectory() as folder:
        out = [clouds.write(Path(folder) / f"a{suffix}", FEW).read_bytes()]
        out.append(clouds.write(Path(folder) / f"b{suffix}", FEW, None, gps_time=np.arange(4.0)).read_bytes())
        return out


@functools.cache
def recordings() -> Sequence[bytes]:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "flight.mcap"
        with path.open("wb") as file:
            writer = Writer(file)
            writer.start()
            values = {row.name: row.default for row in params.rows()}
            import json

            writer.add_metadata(
                journal.METADATA,
                {"version": "1", "lidar": "livox", "clock_offset_ns": "5", "parameters": json.dumps(values)},
            )
            channels = {t: writer.register_channel(t, "", 0) for t in sorted(journal.TOPICS)}
            for k, topic in enumerate(sorted(journal.TOPICS)):
                data = (
                    journal.pack_batch([(1, b"abc"), (2, b"")]) if topic == journal.LIDAR else b'{"asked": 5}'
                )
                writer.add_message(channels[topic], k, data, k)
            writer.finish()
        return [path.read_bytes()]


def captures() -> Sequence[bytes]:
    head = struct.pack("<IHHiIII", 0xA1B2C3D4, 2, 4, 0, 0, 65535, 1)
    udp = struct.pack(">HHHH", 56300, 56301, 12, 0) + b"data"
    ip = (
        struct.pack(">BBHHHBBH4s4s", 0x45, 0, 20 + len(udp), 1, 0, 64, 17, 0, b"\x0a\0\0\1", b"\x0a\0\0\2")
        + udp
    )
    part = (
        struct.pack(">BBHHHBBH4s4s", 0x45, 0, 28, 2, 0x2000, 64, 17, 0, b"\x0a\0\0\1", b"\x0a\0\0\2")
        + udp[:8]
    )
    out = head
    for packet in (ip, part, ip):
        frame = bytes(12) + b"\x08\0" + packet
        out += struct.pack("<IIII", 1_700_000_000, 0, len(frame), len(frame)) + frame
    section = struct.pack("<IIIHHq", 0x0A0D0D0A, 28, 0x1A2B3C4D, 1, 0, -1) + struct.pack("<I", 28)
    interface = struct.pack("<IIHHII", 1, 20, 1, 0, 65535, 20)
    frame = bytes(12) + b"\x08\0" + ip
    padded = frame + bytes(-len(frame) % 4)
    size = 32 + len(padded)
    packet = (
        struct.pack("<IIIIIII", 6, size, 0, 0, 5, len(frame), len(frame)) + padded + struct.pack("<I", size)
    )
    return [out, section + interface + packet]


def logs() -> Sequence[bytes]:
    stamp = struct.pack(">Q", 1_700_000_000_000_000)
    return [b"".join(stamp + frame for frame in mavlink_frames()[:12])]


TEXT = b"# x y z\n1 2 3\n4,5,6\n7;8;9\n"
HARNESSES = (
    Harness("las", las, file_target(".las", read_cloud), words=(b"LASF", b"\xff\xff\xff\xff"), cost=40),
    Harness(
        "laz",
        lambda: las(".laz"),
        file_target(".laz", read_cloud),
        words=(b"LASF", b"laszip encoded"),
        cost=60,
    ),
    Harness(
        "pcd",
        lambda: [
            packing.pcd(FEW, data, form)
            for data in ("ascii", "binary", "binary_compressed")
            for form in ("<f4", "<f8")
        ],
        file_target(".pcd", read_cloud),
        words=(b"POINTS ", b"WIDTH ", b"SIZE ", b"COUNT ", b"FIELDS ", b"DATA binary_compressed\n", b"\n"),
        cost=10,
    ),
    Harness(
        "ply",
        lambda: [packing.ply(FEW, form) for form in ("ascii", "binary_little_endian", "binary_big_endian")],
        file_target(".ply", read_cloud),
        words=(b"element vertex ", b"property list uchar int x\n", b"property double x\n", b"end_header\n"),
        cost=10,
    ),
    Harness(
        "text",
        lambda: [TEXT, b"x,y,z,i\n1,2,3,4\n"],
        file_target(".xyz", read_cloud),
        words=(b",", b";", b"\t", b"//", b"nan", b"\r\n", b"x", b"inf"),
        cost=20,
    ),
    Harness("mcap", recordings, file_target(".mcap", read_recording), words=(b"\x89MCAP0\r\n",), cost=20),
    Harness("pcap", captures, file_target(".pcap", lambda path: list(Capture(path).datagrams())), cost=8),
    Harness("tlog", logs, file_target(".tlog", lambda path: list(TelemetryLog(path).messages())), cost=8),
)
