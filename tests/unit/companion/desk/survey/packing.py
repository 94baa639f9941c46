"""Writers of PCD, PLY, text and COPC files of given points, directly from their formats' specifications."""

from __future__ import annotations

import io
import struct
from pathlib import Path

import laspy
import lazrs
import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


def pcd(points: Floats, data: str = "binary", form: str = "<f8") -> bytes:
    """Return a PCD file with an intensity before and a normal of three numbers after the coordinates."""
    size = np.dtype(form).itemsize
    head = (
        "# .PCD v0.7 - Point Cloud Data file format\nVERSION 0.7\nFIELDS intensity x y z normal\n"
        f"SIZE 1 {size} {size} {size} 4\nTYPE U F F F F\nCOUNT 1 1 1 1 3\nWIDTH {len(points)}\nHEIGHT 1\n"
        f"VIEWPOINT 0 0 0 1 0 0 0\nPOINTS {len(points)}\nDATA {data}\n"
    ).encode()
    kinds = [("i", "u1"), ("x", form), ("y", form), ("z", form), ("n", "<f4", 3)]
    table = np.zeros(len(points), kinds)
    table["i"] = 7
    for k, name in enumerate("xyz"):
        table[name] = points[:, k]
    if data == "ascii":
        lines = (f"7 {x!r} {y!r} {z!r} 0 0 1" for x, y, z in points.tolist())
        return head + "\n".join(lines).encode() + b"\n"
    if data == "binary":
        return head + table.tobytes()
    plain = b"".join(np.ascontiguousarray(table[name]).tobytes() for name in table.dtype.names or ())
    packed = lzf(plain)
    return head + struct.pack("<II", len(packed), len(plain)) + packed


def pcd_of(columns: dict[str, Floats], data: str = "binary") -> bytes:
    """Return a PCD file of float64 fields."""
    table = np.column_stack(list(columns.values()))
    many = len(columns)
    head = (
        f"VERSION 0.7\nFIELDS {' '.join(columns)}\nSIZE{' 8' * many}\nTYPE{' F' * many}\nCOUNT{' 1' * many}\n"
        f"WIDTH {len(table)}\nHEIGHT 1\nPOINTS {len(table)}\nDATA {data}\n"
    ).encode()
    if data == "ascii":
        return head + "\n".join(" ".join(map(repr, row)) for row in table.tolist()).encode() + b"\n"
    if data == "binary":
        return head + table.astype("<f8").tobytes()
    plain = np.ascontiguousarray(table.T, "<f8").tobytes()
    packed = lzf(plain)
    return head + struct.pack("<II", len(packed), len(plain)) + packed


def lzf(plain: bytes) -> bytes:
    """Pack runs of one byte as references, all else as it is."""
    out, literal, i = bytearray(), bytearray(), 0

    def flush() -> None:
        for k in range(0, len(literal), 32):
            part = literal[k : k + 32]
            out.extend([len(part) - 1, *part])
        literal.clear()

    while i < len(plain):
        run = 1
        while i + run < len(plain) and plain[i + run] == plain[i] and run < 265:
            run += 1
        literal.append(plain[i])
        i += 1
        if run > 4:
            flush()
            length = run - 1  # bytes to repeat, from a distance of one
            out.extend([(length - 2) << 5, 0] if length < 9 else [7 << 5, length - 9, 0])
            i += length
    flush()
    return bytes(out)


def ply(points: Floats, form: str = "binary_little_endian", kind: str = "double") -> bytes:
    """Return a PLY file of one camera, then vertices with a colour, then a face."""
    order = ">" if form == "binary_big_endian" else "<"
    head = (
        f"ply\nformat {form} 1.0\ncomment made by a test\nelement camera 1\nproperty float focus\n"
        f"element vertex {len(points)}\nproperty uchar red\nproperty {kind} x\nproperty {kind} y\n"
        f"property {kind} z\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n"
    ).encode()
    if form == "ascii":
        lines = (f"200 {x!r} {y!r} {z!r}" for x, y, z in points.tolist())
        return head + b"0.5\n" + "\n".join(lines).encode() + b"\n3 0 1 2\n"
    number = order + {"double": "f8", "float": "f4", "int": "i4"}[kind]
    table = np.zeros(len(points), [("r", "u1"), ("x", number), ("y", number), ("z", number)])
    for k, name in enumerate("xyz"):
        table[name] = points[:, k]
    return head + struct.pack(order + "f", 0.5) + table.tobytes() + struct.pack(order + "B3i", 3, 0, 1, 2)


def text(points: Floats, separator: str = " ", header: str = "") -> bytes:
    """Return lines of x, y, z and an intensity."""
    lines = [separator.join([*map(repr, row), "7"]) for row in points.tolist()]
    return "\n".join([header, *lines] if header else lines).encode() + b"\n"


def copc(path: Path, las: Path) -> Path:
    """Rewrite a LAS file of point format 6 as COPC 1.0: one node, chunks of any size, info and hierarchy."""
    from laspy.vlrs.vlr import VLR

    with laspy.open(las) as reader:
        header, data = reader.header, reader.read().points.array.tobytes()
    vlr = lazrs.LazVlr.new_for_compression(6, 0, True)
    packed = io.BytesIO()
    compressor = lazrs.LasZipCompressor(packed, vlr)
    compressor.reserve_offset_to_chunk_table()
    half = len(data) // 60 * 30
    compressor.compress_many(np.frombuffer(data[:half], np.uint8))
    compressor.finish_current_chunk()
    compressor.compress_many(np.frombuffer(data[half:], np.uint8))
    compressor.done()
    info = VLR("copc", 1, "COPC info", bytes(160))
    records = [info, *header.vlrs, VLR("laszip encoded", 22204, "laszip", bytes(vlr.record_data()))]
    body = b"".join(
        struct.pack("<H16sHH32s", 0, v.user_id.encode(), v.record_id, len(d), v.description.encode()) + d
        for v in records
        for d in [v.record_data_bytes()]
    )
    head = bytearray(las.read_bytes()[:375])
    points_at = 375 + len(body)
    struct.pack_into("<II", head, 96, points_at, len(records))
    head[104] |= 0x80
    points = packed.getvalue()
    (table_at,) = struct.unpack_from("<q", points)
    points = struct.pack("<q", table_at + points_at) + points[8:]
    entry = struct.pack("<4iQii", 0, 0, 0, 0, points_at + 8, table_at - 8, len(data) // 30)
    extended = struct.pack("<H16sHQ32s", 0, b"copc", 1000, len(entry), b"COPC hierarchy") + entry
    struct.pack_into("<QI", head, 235, points_at + len(points), 1)
    struct.pack_into("<QQ", body_copy := bytearray(body), 54 + 40, points_at + len(points) + 60, len(entry))
    path.write_bytes(bytes(head) + bytes(body_copy) + points + extended)
    return path
