"""Reader of LAS and LAZ files (ASPRS LAS 1.4 R15), including COPC 1.0, whose index is not used."""

from __future__ import annotations

import math
import struct
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, BinaryIO

import laspy
import numpy as np
from numpy.typing import NDArray

from companion.desk.clouds.cloud_source import CHUNK, NO_STEPS, Chunk, Clock, is_transient, translated, unread
from companion.desk.clouds.crs import Reference, of_header
from companion.desk.clouds.laz_chunks import check_chunks, check_none_follow
from companion.desk.clouds.laz_reader import read_points
from companion.runtime.errors import UsageError

SHORTEST, SHORTEST_1_4 = 227, 375  # bytes of a LAS header (ASPRS LAS 1.4 R15, table 3)
FORMAT_AT, COMPRESSED = 104, 0xC0  # offset of the point format, and its two highest bits
RECORD_BYTES, EXTENDED_BYTES = 54, 60  # smallest variable length record and extended one
EXTENDED_LENGTH_AT = 20  # of the bytes behind an extended record's head

# ASPRS classes. Noise is no ground. Nothing can land on water, so its points are dropped and it stays unseen.
LOW_NOISE, HIGH_NOISE = 7, 18
# 40 to 45: Topo-Bathy domain profile: bed, water surface, derived surface, submerged object, no bottom.
# 44, an object of a sea chart, may rise above the water, so it is kept as evidence.
WATER = (9, 40, 41, 42, 43, 45)
COPC = "copc"
# Layers of LAZ 1.4 (point formats 6 to 10) that are decompressed for a map; older formats have no layers.
LAYERS = (
    laspy.DecompressionSelection.XY_RETURNS_CHANNEL
    | laspy.DecompressionSelection.Z
    | laspy.DecompressionSelection.CLASSIFICATION
    | laspy.DecompressionSelection.FLAGS
)


@dataclass(frozen=True, slots=True)
class Columns:
    """Points of a part of a file by coordinate, and the mask of those to use.

    x, y, z: (n,) float64 contiguous, CRS units. keep: (n,) bool. mark: (n,) uint8, see
    `slz.kernels.survey.surface_sums`. n_read, dropped: as in `Chunk`.
    """

    x: NDArray[np.float64]
    y: NDArray[np.float64]
    z: NDArray[np.float64]
    keep: NDArray[np.bool_]
    mark: NDArray[np.uint8]
    n_read: int
    dropped: dict[str, int]


@dataclass(frozen=True, slots=True)
class LasSource:
    """A LAS or LAZ file, see `Source`."""

    path: Path
    n_points: int
    reference: Reference
    clock: Clock | None
    single: bool = False
    seekable: bool = True
    low: tuple[float, float] | None = None
    """Least x and y in the header."""
    high: tuple[float, float] | None = None
    scales: tuple[float, float, float] = NO_STEPS

    def chunks(self) -> Iterator[Chunk]:
        from slz import PointAttributes

        for piece in pieces(self.path, self.n_points):
            dropped: dict[str, int] = {}
            points, keep = _usable(piece, dropped)
            gps_s = None if self.clock is None else np.asarray(piece.gps_time, np.float64)[keep]
            attributes = PointAttributes.of(
                np.asarray(piece.intensity)[keep],
                np.asarray(piece.return_number, np.uint8)[keep],
                np.asarray(piece.number_of_returns, np.uint8)[keep],
            )
            yield Chunk(points, gps_s, len(piece), dropped, attributes)

    def columns(self, first: int, stop: int) -> Iterator[Columns]:
        """Read points `first` to `stop`, only the fields that a map needs.

        Raises
        ------
        UsageError
            The file is truncated or corrupt.
        """
        n = first
        with (
            translated(self.path),
            laspy.open(
                self.path,
                encoding_errors="replace",
                decompression_selection=LAYERS,
                laz_backend=[laspy.LazBackend.Lazrs],  # single-threaded, since other cores run workers
            ) as reader,
        ):
            if first:
                reader.seek(first)
            while n < stop:
                piece = reader.read_points(min(CHUNK, stop - n))
                if not len(piece):
                    break
                n += len(piece)
                with np.errstate(invalid="ignore", over="ignore"):
                    x, y, z = (np.ascontiguousarray(piece[axis], np.float64) for axis in "xyz")
                dropped: dict[str, int] = {}
                keep = _kept(piece, (x, y, z), dropped)
                yield Columns(x, y, z, keep, _marks(piece), len(piece), dropped)
        if n != stop:
            raise UsageError(f"{self.path}: it is truncated, {n} of {stop} points: copy it again")


def open_las(path: Path, given: Reference | None, vertical_unit: str | None = None) -> LasSource:
    """Read and check the header of a LAS or LAZ file; given, vertical_unit: as in `of_header`.

    Raises
    ------
    UsageError
        The file is empty, truncated, corrupt or without a usable CRS.
    """
    check_header(path)
    with translated(path), laspy.open(path, encoding_errors="replace") as reader:
        header = reader.header
        n_points = int(header.point_count)
        names = set(header.point_format.dimension_names)
        standard = bool(header.global_encoding.gps_time_type)
        scales = [float(scale) for scale in header.scales]
        if not all(math.isfinite(scale) and scale != 0 for scale in scales):
            listed = ", ".join(f"{scale:g}" for scale in scales)
            raise UsageError(f"{path}: its header is corrupt, its scales are {listed}: copy it again")
        offsets = [float(offset) for offset in header.offsets]
        if not all(math.isfinite(offset) for offset in offsets):
            listed = ", ".join(f"{offset:g}" for offset in offsets)
            raise UsageError(f"{path}: its header is corrupt, its offsets are {listed}: copy it again")
        size, least = path.stat().st_size, int(header.offset_to_point_data)
        point_bytes = int(header.point_format.size)
        if not header.are_points_compressed:
            least += n_points * point_bytes
        if size < least:
            raise UsageError(
                f"{path}: it is truncated, {size} bytes where its header asks for {least}: copy it again"
            )
        if header.are_points_compressed:
            for packing in header.vlrs.get("LasZipVlr"):
                check_chunks(path, least, point_bytes, bytes(packing.record_data), n_points)
        else:
            check_none_follow(path, n_points, (_end(header, size) - least) // point_bytes)
        if not n_points:
            raise UsageError(f"{path}: it holds no points")
        clock: Clock | None = ("standard" if standard else "week") if "gps_time" in names else None
        corners = [(float(edge[0]), float(edge[1])) for edge in (header.mins, header.maxs)]
        seekable = not any(vlr.user_id == COPC for vlr in header.vlrs)
        return LasSource(
            path,
            n_points,
            of_header(header, path, given, vertical_unit),
            clock,
            seekable=seekable,
            low=corners[0],
            high=corners[1],
            scales=(abs(scales[0]), abs(scales[1]), abs(scales[2])),
        )


def _end(header: Any, size: int) -> int:
    """Return the latest possible end of the points of an uncompressed file."""
    extended = header.start_of_first_evlr if header.number_of_evlrs else 0
    return min([size, *(int(at) for at in (extended, header.start_of_waveform_data_packet_record) if at)])


def pieces(path: Path, n_points: int) -> Iterator[Any]:
    """Read a file's points with all dimensions, a million at a time.

    Raises
    ------
    UsageError
        The file is truncated or corrupt.
    """
    n = 0
    with translated(path), laspy.open(path, encoding_errors="replace") as reader:
        compressed = reader.header.are_points_compressed
        for piece in read_points(path, reader.header) if compressed else reader.chunk_iterator(CHUNK):
            n += len(piece)
            yield piece
    if n != n_points:
        raise UsageError(f"{path}: it is truncated, {n} of {n_points} points: copy it again")


def coordinates(piece: Any) -> NDArray[np.float64]:
    """Return (n, 3) CRS coordinates of a laspy point record."""
    with np.errstate(invalid="ignore", over="ignore"):
        return np.column_stack([np.asarray(piece[axis], np.float64) for axis in "xyz"])


def _usable(piece: Any, dropped: dict[str, int]) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """Return the coordinates of the points to use, and their mask; count the others."""
    xyz = coordinates(piece)
    keep = _kept(piece, tuple(xyz.T), dropped)
    return xyz[keep], keep


def _marks(piece: Any) -> NDArray[np.uint8]:
    """Return number of echoes and class of each point, as bits; inconsistent return numbers are unknown."""
    from slz.kernels.survey import surface_sums as marks

    number, several = np.asarray(piece.return_number), np.asarray(piece.number_of_returns)
    consistent = (number >= 1) & (number <= several)
    # By ASPRS class; the last one is that of all higher classes.
    kinds = np.full(8, marks.UNCLASSIFIED, np.uint8)
    kinds[2:7] = marks.GROUND, marks.LOW_PLANT, marks.TALL_PLANT, marks.TALL_PLANT, marks.BUILDING
    kind = kinds[np.minimum(np.asarray(piece.classification), len(kinds) - 1)]
    echoes = consistent * marks.NUMBERED | (consistent & (several > 1)) * marks.SEVERAL
    return np.asarray(echoes | kind << marks.CLASS_SHIFT, np.uint8)


def _kept(piece: Any, axes: tuple[NDArray[np.float64], ...], dropped: dict[str, int]) -> NDArray[np.bool_]:
    """Return the mask of the points to use; count the others by reason."""
    kind = np.asarray(piece.classification)
    keep = np.ones(len(kind), bool)
    for reason, bad in (
        ("withheld", np.asarray(piece.withheld) != 0),
        ("noise", (kind == LOW_NOISE) | (kind == HIGH_NOISE)),
        ("water", np.isin(kind, WATER)),
        ("not_finite", ~np.logical_and.reduce([np.isfinite(values) for values in axes])),
    ):
        dropped[reason] = int(np.count_nonzero(keep & bad))
        keep &= ~bad
    return keep


def check_header(path: Path) -> None:
    """Refuse a LAS or LAZ file whose header refers to more than the file holds.

    Raises
    ------
    UsageError
        Missing, unreadable, truncated or corrupt.
    """
    try:
        with path.open("rb") as file:
            head = file.read(SHORTEST_1_4)
            size = path.stat().st_size
            chunks = _chunks(file, head, size)
            records_end = _extended_end(file, head, size)
    except FileNotFoundError:
        raise UsageError(f"{path}: no such file") from None
    except OSError as error:
        if is_transient(error):
            raise unread(path, error) from None
        raise UsageError(f"{path}: cannot be read: {error.strerror}") from None
    if len(head) < SHORTEST:
        raise UsageError(f"{path}: it is truncated within its header: copy it again")
    major, minor = head[24], head[25]
    if major != 1 or minor > 4:
        raise UsageError(f"{path}: it is LAS {major}.{minor}, and only 1.0 to 1.4 are supported")
    header_size, points_at, records = struct.unpack_from("<HII", head, 94)
    needed = header_size + records * RECORD_BYTES
    if points_at > size:
        raise UsageError(f"{path}: it is truncated, its points lie beyond its end: copy it again")
    if chunks > size:  # lazrs would allocate memory for them, and abort the process on failure
        raise UsageError(
            f"{path}: it is truncated or corrupt, its table names {chunks} chunks: copy it again"
        )
    if header_size < (SHORTEST_1_4 if minor == 4 else SHORTEST) or needed > points_at:
        raise UsageError(f"{path}: its header is corrupt: copy it again")
    if records_end > size:  # laspy would allocate memory for them
        raise UsageError(f"{path}: it is truncated or corrupt in its last records: copy it again")


def _extended_end(file: BinaryIO, head: bytes, size: int) -> int:
    """Return the end of the extended records by their own lengths, 0 without any."""
    if len(head) < SHORTEST_1_4 or head[25] != 4:
        return 0
    at, extended = struct.unpack_from("<QI", head, 235)
    if not extended:
        return 0
    for _ in range(extended):
        length = _number(file, at + EXTENDED_LENGTH_AT, "<Q")
        if length is None:
            return size + 1
        at += EXTENDED_BYTES + length
    return int(at)


def _chunks(file: BinaryIO, head: bytes, size: int) -> int:
    """Return the number of chunks of compressed points that a LAZ file states, 0 where it states none.

    The first 8 bytes of the points are the offset of the chunk table, or -1 if that is in the last 8 bytes
    of the file. The table begins with its version and the number of chunks (LASzip, laszip.org).
    """
    if len(head) < SHORTEST or not head[FORMAT_AT] & COMPRESSED:
        return 0
    (points_at,) = struct.unpack_from("<I", head, 96)
    place = _number(file, points_at, "<q")
    if place == -1:
        place = _number(file, size - 8, "<q")
    return 0 if place is None or place < 0 else _number(file, place + 4, "<I") or 0


def _number(file: BinaryIO, at: int, form: str) -> int | None:
    """Return a number at an offset of a file, None beyond its end."""
    file.seek(max(0, min(at, 2**62)))
    data = file.read(struct.calcsize(form))
    return int(struct.unpack(form, data)[0]) if len(data) == struct.calcsize(form) else None
