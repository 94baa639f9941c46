"""Reader of recordings in the order of writing, up to their end, even if it is cut off."""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, BinaryIO

from mcap.exceptions import EndOfFile, InvalidMagic, RecordLengthLimitExceeded
from mcap.records import Channel, DataEnd, Message, Metadata
from mcap.stream_reader import StreamReader

import params
from companion.flight.recorder import journal
from companion.runtime.errors import UsageError
from params import ParameterError, Parameters


@dataclass(frozen=True, slots=True)
class Header:
    """Metadata of a recording: kind of sensor, parameters, time of day less the companion's clock.

    lidar_metadata: the sensor's metadata, where its packets do not suffice. scans: number of scans before
    the recording began. system, remembered: the vehicle's, as far as it was known by then, and that of the
    previous run (`VehicleIdentity`). gated: positions were held back until one came with a fix
    (`PositionGate`). odometry: topic of an external odometry, empty without one.
    """

    lidar: str
    values: dict[str, Any]
    clock_offset_ns: int
    lidar_metadata: str = ""
    scans: int = 0
    system: int | None = None
    remembered: int | None = None
    gated: bool = False
    odometry: str = ""

    def parameters(self, settings: Iterable[str] = ()) -> Parameters:
        """Return the flight's parameters, with those of `settings` (`name=value`) replaced.

        Raises
        ------
        ParameterError
            A setting is wrong, or contradicts the others.
        """
        return params.load("quadcopter", settings, self.values)


@dataclass(frozen=True, slots=True)
class Raw:
    """One raw message, stamped with the companion's clock."""

    topic: str
    at_ns: int
    data: bytes


class RecordingReader:
    """A file of `slz run --record`.

    Attributes
    ----------
    header
        Its metadata.
    cut
        Reason for the missing end, empty where it is complete; known once all messages were read.

    Raises
    ------
    UsageError
        It cannot be read, is no MCAP file, or not of this program.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self.cut = ""
        header = next((r for r in self._records() if isinstance(r, Header)), None)
        if header is None:
            raise UsageError(f"{path} is no recording of slz: it has no metadata '{journal.METADATA}'")
        self.header = header

    def messages(self) -> Iterator[Raw]:
        """Yield the messages for a replay, in the order of the flight."""
        offset_ns = self.header.clock_offset_ns
        for record in self._records():
            if isinstance(record, Raw):
                yield Raw(record.topic, record.at_ns - offset_ns, record.data)

    def _records(self) -> Iterator[Raw | Header]:
        try:
            with self._path.open("rb") as file:
                yield from self._read(file)
        except OSError as error:
            raise UsageError(f"{self._path} cannot be read: {error.strerror or error}") from None

    def _read(self, file: BinaryIO) -> Iterator[Raw | Header]:
        topics: dict[int, str] = {}
        whole = False
        try:
            for record in StreamReader(file, validate_crcs=True).records:
                if isinstance(record, Channel) and record.topic in journal.TOPICS:
                    topics[record.id] = record.topic
                elif isinstance(record, Message) and record.channel_id in topics:
                    yield Raw(topics[record.channel_id], record.log_time, record.data)
                elif isinstance(record, Metadata) and record.name == journal.METADATA:
                    yield self._header(record.metadata)
                whole = whole or isinstance(record, DataEnd)
        except InvalidMagic:
            if not whole:
                raise UsageError(f"{self._path} is no MCAP file") from None
        except (EndOfFile, RecordLengthLimitExceeded):
            self.cut = "" if whole else "it ends in the middle, as after a loss of power"
        except UsageError:
            raise
        except Exception as error:  # raised by mcap, or by the decompressors of its chunks
            self.cut = "" if whole else f"it is damaged or cut off: {error}"

    def _header(self, metadata: dict[str, str]) -> Header:
        try:
            version = int(metadata["version"])
            stored = json.loads(metadata["parameters"])
            values = {params.RENAMED.get(name, name): value for name, value in stored.items()}
            lidar_metadata = metadata.get("lidar_setup", "")
            scans = int(metadata.get("scans", "0"))
            system, remembered = (int(metadata.get(name) or 0) or None for name in ("system", "remembered"))
            header = Header(
                metadata["lidar"],
                values,
                int(metadata["clock_offset_ns"]),
                lidar_metadata,
                scans,
                system,
                remembered,
                gated=metadata.get("gated") == "1",
                odometry=metadata.get("odometry", ""),
            )
            params.build(values)
        except ParameterError as error:
            raise UsageError(f"{self._path}: {error}") from None
        except (AttributeError, KeyError, TypeError, ValueError) as error:
            raise UsageError(f"{self._path}: its metadata cannot be read: {error!r}") from None
        if version != journal.VERSION:
            raise UsageError(f"{self._path} is of version {version}, this program reads {journal.VERSION}")
        return header
