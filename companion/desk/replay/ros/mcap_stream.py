"""Reader of an MCAP bag without its index: files that are cut off, or written again by other tools.

It has the interface of a reader of the library rosbags, which refuses files without an end and those of
another profile than ros2.
"""

from __future__ import annotations

import struct
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO

import lz4.frame  # type: ignore[import-untyped]
import zstandard
from mcap.opcode import Opcode
from mcap.records import Channel, Chunk, DataEnd, McapRecord, Message, Schema
from mcap.stream_reader import StreamReader, breakup_chunk

from companion.flight.recorder import journal

ROS1, ROS2 = ("ros1", "ros1msg"), ("cdr", "ros2msg", "ros2idl")  # encodings of messages and schemas


MAGIC_BYTES = 8
# Of a chunk: first and last time, plain bytes, checksum, and length of the compression's name.
CHUNK_HEAD = struct.Struct("<QQQII")


class CutError(ValueError):
    """The file's end, or a part of it, is missing."""


@dataclass(frozen=True, slots=True)
class TopicChannel:
    """Channel of a file, as rosbags' connection. msgdef: format and text of its definition."""

    id: int
    topic: str
    msgtype: str
    msgdef: tuple[object, str]


@dataclass(frozen=True, slots=True)
class TopicCount:
    """Type and number of messages of a topic."""

    msgtype: str
    msgcount: int


class McapStream:
    """Bag in one MCAP file.

    Attributes
    ----------
    connections, topics
        Channels of the file, and types and counts by topic; known once it is open.
    ros1
        Its messages are of ROS 1.

    Raises
    ------
    CutError
        It holds no channel of ROS.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self.connections: list[TopicChannel] = []
        self.topics: dict[str, TopicCount] = {}
        self.ros1 = False

    def open(self) -> None:
        """Read the channels."""
        found: dict[int, TopicChannel] = {}
        counts: Counter[int] = Counter()
        schemas: dict[int, Schema] = {}
        try:
            for record in self._records():
                if isinstance(record, Schema):
                    schemas[record.id] = record
                elif isinstance(record, Channel) and record.message_encoding in (ROS1[0], ROS2[0]):
                    self.ros1 = record.message_encoding == ROS1[0]
                    found[record.id] = _topic_channel(record, schemas.get(record.schema_id))
                elif isinstance(record, Message):
                    counts[record.channel_id] += 1
        except CutError:
            if not found:
                raise
        self.connections = list(found.values())
        for one in self.connections:
            before = self.topics.get(one.topic, TopicCount(one.msgtype, 0)).msgcount
            self.topics[one.topic] = TopicCount(one.msgtype, before + counts[one.id])
        if not found:
            raise CutError("it has no topic of ROS")

    def messages(self, connections: Sequence[TopicChannel]) -> Iterator[tuple[TopicChannel, int, bytes]]:
        """Yield channel, time of recording (ns) and bytes of the messages of some channels."""
        wanted = {one.id: one for one in connections}
        for record in self._records():
            if isinstance(record, Message) and record.channel_id in wanted:
                yield wanted[record.channel_id], record.log_time, record.data

    def close(self) -> None:
        """Do nothing: the file is open only while it is read."""

    def _records(self) -> Iterator[McapRecord]:
        """Yield all records up to the end; damaged chunks are left out.

        Raises
        ------
        CutError
            The end or a chunk is missing, after all that is there was read.
        """
        damaged, whole = 0, False
        with self._path.open("rb") as file:
            records = StreamReader(file, emit_chunks=True).records
            at = MAGIC_BYTES
            while not whole:
                try:
                    record = next(records)
                except Exception as error:  # raised by mcap
                    yield from _of_cut_chunk(file, at)
                    ends = not file.read(1) and file.tell() > MAGIC_BYTES
                    why = "ends in the middle, as after a loss of power" if ends else f"is damaged: {error}"
                    raise CutError(f"it {why}") from None
                at = file.tell()
                whole = isinstance(record, DataEnd)
                if not isinstance(record, Chunk):
                    yield record
                    continue
                try:
                    inner = breakup_chunk(record, validate_crc=True)
                except Exception:  # raised by mcap, or by a decompressor
                    damaged += 1
                    continue
                yield from inner
        if damaged:
            raise CutError(f"{damaged} of its chunks are damaged and left out")


def _of_cut_chunk(file: BinaryIO, at: int) -> list[McapRecord]:
    """Return the whole records of a chunk at an offset that the file's end cuts; none if it is no chunk."""
    file.seek(at)
    head = file.read(9 + CHUNK_HEAD.size)
    if len(head) < 9 + CHUNK_HEAD.size or head[0] != Opcode.CHUNK:
        return []
    start_ns, end_ns, _, _, name_bytes = CHUNK_HEAD.unpack_from(head, 9)
    name, data = file.read(name_bytes).decode("ascii", "replace"), file.read()[8:]
    try:
        if name == "zstd":
            plain = zstandard.ZstdDecompressor().decompressobj().decompress(data)
        elif name == "lz4":
            plain = lz4.frame.LZ4FrameDecompressor().decompress(data)
        else:
            plain = data
    except Exception:  # raised by the decompressors
        return []
    end = 0
    while end + 9 <= len(plain):
        after = end + 9 + int.from_bytes(plain[end + 1 : end + 9], "little")
        if after > len(plain):
            break
        end = after
    whole = Chunk(
        compression="",
        data=plain[:end],
        message_start_time=start_ns,
        message_end_time=end_ns,
        uncompressed_crc=0,
        uncompressed_size=end,
    )
    try:
        return breakup_chunk(whole)
    except Exception:  # raised by mcap
        return []


def _topic_channel(channel: Channel, schema: Schema | None) -> TopicChannel:
    from rosbags.interfaces import MessageDefinitionFormat as Format

    name, encoding, data = ("", "", b"") if schema is None else (schema.name, schema.encoding, schema.data)
    if "/msg/" not in name:  # as ROS 1 writes them
        name = name.replace("/", "/msg/", 1)
    forms = {"ros2idl": Format.IDL, "ros2msg": Format.MSG, "ros1msg": Format.MSG}
    return TopicChannel(
        channel.id, channel.topic, name, (forms.get(encoding, Format.NONE), data.decode("utf-8", "replace"))
    )


def is_bag(path: Path) -> bool:
    """Return whether an MCAP file is a bag of ROS by its profile, its schemas or its messages' encoding.

    False for a recording of this program, and for a file that cannot be read.
    """
    try:
        with path.open("rb") as file:
            for record in StreamReader(file).records:
                if getattr(record, "profile", "").startswith("ros"):
                    return True
                if getattr(record, "name", "") == journal.METADATA and hasattr(record, "metadata"):
                    return False
                if isinstance(record, Schema) and record.encoding in (*ROS1, *ROS2):
                    return True
                if isinstance(record, Channel) and record.message_encoding in (*ROS1, *ROS2):
                    return True
                if isinstance(record, Message):
                    return False
    except Exception:  # raised by mcap and decompressors; the reader will report the error
        return False
    return False
