"""Reader of ROS 1 and ROS 2 bags, based on the library rosbags."""

from __future__ import annotations

import struct
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from companion.desk.replay.ros import livox_message
from companion.desk.replay.ros.mcap_stream import McapStream, TopicChannel
from companion.flight.sensors.decoders.point_cloud import StampedCloud, table_of
from companion.runtime import extras
from companion.runtime.errors import UsageError

METADATA, STORED = "metadata.yaml", (".mcap", ".db3")
CLOUD = "sensor_msgs/msg/PointCloud2"
CLOUDS = (CLOUD, *livox_message.MESSAGES)
STAMP_ENDS = 12  # bytes of a message up to the end of its header's stamp
# Packages of the types that are read, and of their fields.
PACKAGES = ("sensor_msgs", "nav_msgs", "geometry_msgs", "std_msgs", "builtin_interfaces")


class BagFile:
    """A folder, .db3, .mcap or .bag; an .mcap that is damaged, cut off or of another profile is read, too.

    Types are read as the bag defines them; where it only names a type, or its definition cannot be parsed,
    the library's own definition is used. Types of other packages are ignored.

    Attributes
    ----------
    types
        Type of each topic that has messages.
    bad
        Number of unreadable messages up to now.
    cut
        Reason for the missing end, or empty; known once all was read.

    Raises
    ------
    UsageError
        It cannot be read, or the library is not installed.
    """

    def __init__(self, path: Path) -> None:
        self._path = _only_file(path)
        self.bad, self.cut = 0, ""
        self._ros2 = self._path.suffix.lower() != ".bag"
        with self._opened() as reader:
            self._ros2 = self._ros2 and not getattr(reader, "ros1", False)
            self.types = {name: info.msgtype or "" for name, info in reader.topics.items() if info.msgcount}
            self._store = _store(reader.connections, self._ros2)

    def messages(self, topics: Sequence[str]) -> Iterator[tuple[int, int, str, Any]]:
        """Yield times of recording and of the header (ns), topic and message, in the order of recording.

        A header's time of 0 is none. A cloud of any type is a `StampedCloud`.
        """
        self.bad = 0
        for connection, at_ns, raw in self._raws(topics):
            try:
                message = self._message(raw, connection.msgtype)
                stamp_ns = _stamp_ns(message)
            except Exception:  # the generated code may raise anything
                self.bad += 1
                continue
            yield at_ns, stamp_ns, connection.topic, message

    def times(self, topics: Sequence[str]) -> Iterator[tuple[int, int, str]]:
        """Yield times of recording and of the header (ns), and topic, of messages not read further."""
        for connection, at_ns, raw in self._raws(topics):
            if len(raw) >= STAMP_ENDS:
                order = "<" if not self._ros2 or raw[1] & 1 else ">"
                seconds, nanoseconds = struct.unpack_from(order + ("iI" if self._ros2 else "II"), raw, 4)
                yield at_ns, seconds * 1_000_000_000 + nanoseconds, connection.topic

    def _raws(self, topics: Sequence[str]) -> Iterator[tuple[Any, int, bytes]]:
        """Yield connection, time of recording and bytes of the messages that can be reached."""
        self.cut = ""
        with self._opened() as reader:
            wanted = [c for c in reader.connections if c.topic in topics]
            raws = reader.messages(connections=wanted) if wanted else iter(())
            at_ns = -1
            while True:
                try:
                    connection, at_ns, raw = next(raws)
                except StopIteration:
                    return
                except Exception as error:  # raised by SQLite, MCAP, LZ4 or Zstandard
                    self.cut = f"it is damaged or cut off: {_line(error)}"
                    if isinstance(reader, McapStream) or self._path.suffix.lower() != ".mcap":
                        return
                    reader = self._stream(error)
                    raws = _later(reader, topics, at_ns)
                    continue
                yield connection, at_ns, raw

    def _message(self, raw: bytes, kind: str) -> Any:
        if kind in livox_message.MESSAGES:
            return livox_message.parse(raw, kind, self._ros2)
        read = self._store.deserialize_cdr if self._ros2 else self._store.deserialize_ros1
        message: Any = read(raw, kind)
        if kind != CLOUD:
            return message
        return StampedCloud(_stamp_ns(message), str(message.header.frame_id), table_of(message))

    @contextmanager
    def _opened(self) -> Iterator[Any]:
        try:
            from rosbags import rosbag1, rosbag2
        except ImportError:
            raise UsageError(extras.explain(f"{self._path} is a ROS bag", "rosbags", "ros")) from None
        try:
            is_bag1 = self._path.suffix.lower() == ".bag"
            reader: Any = rosbag1.Reader(self._path) if is_bag1 else rosbag2.Reader(self._path)
            reader.open()
        except Exception as error:  # raised by YAML, SQLite, MCAP or the library
            reader = self._stream(error)
        try:
            yield reader
        finally:
            reader.close()

    def _stream(self, error: Exception) -> McapStream:
        """Return the reader of an MCAP file without its index, for one at which the library fails."""
        reader = McapStream(self._path)
        try:
            if self._path.suffix.lower() != ".mcap":
                raise error
            reader.open()
        except Exception as why:  # raised by mcap, or the library's
            raise UsageError(f"{self._path}: it is no ROS bag, or damaged ({_line(why)})") from None
        return reader


def _later(
    reader: McapStream, topics: Sequence[str], at_ns: int
) -> Iterator[tuple[TopicChannel, int, bytes]]:
    """Yield the messages behind a damaged part, recorded after a time."""
    wanted = [one for one in reader.connections if one.topic in topics]
    return (message for message in reader.messages(wanted) if message[1] > at_ns)


def _only_file(path: Path) -> Path:
    """Return the file of a folder without metadata.yaml, as a loss of power leaves it; else the path.

    Raises
    ------
    UsageError
        There are several, or none.
    """
    if not path.is_dir():
        return path
    described = path / METADATA
    if described.exists() and described.stat().st_size:
        return path
    files = sorted(one for one in path.iterdir() if one.suffix.lower() in STORED)
    if len(files) == 1:
        return files[0]
    state = "is empty" if described.exists() else "is missing"
    what = f"it holds {len(files)} files of a bag" if files else "it holds no .mcap or .db3 file"
    way = "make it again by `ros2 bag reindex`, or name one of the files" if files else "name a bag"
    raise UsageError(f"{path}: its {METADATA} {state}, and {what}: {way}")


def _store(connections: Sequence[Any], ros2: bool) -> Any:
    """Return the type store: the library's definitions, replaced by those of the bag."""
    from rosbags.typesys import Stores, get_typestore

    standard = get_typestore(Stores.ROS2_HUMBLE if ros2 else Stores.ROS1_NOETIC)
    store, plain = get_typestore(Stores.EMPTY), get_typestore(Stores.EMPTY)
    kept = {name: fields for name, fields in standard.fielddefs.items() if name.split("/")[0] in PACKAGES}
    plain.register(kept)
    own: dict[str, Any] = {}
    for connection in connections:
        if connection.msgtype.split("/")[0] in PACKAGES:
            own |= _defined(connection)
    try:
        store.register(kept | own)
    except Exception:  # a damaged definition may raise anything
        return plain
    return store


def _defined(connection: Any) -> dict[str, Any]:
    """Return the types that a connection's text defines; none without a text that can be parsed."""
    from rosbags.interfaces import MessageDefinitionFormat
    from rosbags.typesys import get_types_from_idl, get_types_from_msg

    form, text = connection.msgdef
    try:
        if form == MessageDefinitionFormat.MSG:
            found: dict[str, Any] = dict(get_types_from_msg(text, connection.msgtype))
        elif form == MessageDefinitionFormat.IDL:
            found = {}
            for part in text.split("=" * 80 + "\n"):
                found |= get_types_from_idl(part.split("\n", 1)[1] if part.startswith("IDL: ") else part)
        else:
            return {}
    except Exception:  # raised by the parser
        return {}
    _, fields = found.get(connection.msgtype, ([], []))
    return found if fields else {}


def _stamp_ns(message: Any) -> int:
    if isinstance(message, StampedCloud):
        return message.stamp_ns
    stamp = message.header.stamp
    return int(stamp.sec) * 1_000_000_000 + int(stamp.nanosec)


def _line(error: BaseException) -> str:
    return " ".join(f"{error or type(error).__name__}".split())[:120]
