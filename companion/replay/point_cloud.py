"""Messages sensor_msgs/PointCloud2 as batches of returns."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from companion.sensors.returns import Returns

# PointField.datatype
TYPES = {1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 8: "f8"}
# What drivers call a point's time: Velodyne, Ouster, Hesai and RoboSense, Livox, Nebula.
TIMES = ("time", "t", "timestamp", "offset_time", "time_stamp", "time_offset")
INTENSITIES = ("intensity", "reflectivity")
RINGS = ("ring", "line", "channel")
MOST_NS = 10_000_000_000  # a point is never farther than this from its message's stamp


class BadCloudError(ValueError):
    """A point cloud contradicts itself; says how."""


def decode(message: Any, stamp_ns: int) -> tuple[Returns, bool]:
    """Return a cloud's points in the order of their times, and whether they have times of their own.

    stamp_ns: the message's; points without a time get it. A time is taken as it can only be meant: whole
    numbers are nanoseconds, others seconds or nanoseconds, since 1970 or since the stamp, whichever is within
    ten seconds of it.

    Raises
    ------
    BadCloudError
        A field is missing, no number or outside of the point, or data are missing.
    """
    table = _table(message)
    names = table.dtype.names or ()
    missing = [name for name in "xyz" if name not in names]
    if missing:
        raise BadCloudError(f"it has no {' and no '.join(missing)}")
    xyz = np.empty((len(table), 3), np.float32)
    with np.errstate(invalid="ignore", over="ignore"):
        for k, name in enumerate("xyz"):
            xyz[:, k] = table[name]
    stamps = _stamps(table, stamp_ns)
    timed = stamps is not None
    if stamps is None:
        stamps = np.full(len(table), stamp_ns, np.int64)
    order = np.argsort(stamps, kind="stable")
    one = np.ones(len(table), np.uint8)
    returns = Returns(
        xyz[order],
        stamps[order],
        _bytes(table, INTENSITIES)[order],
        _bytes(table, RINGS)[order],
        one,
        one.copy(),
    )
    return returns, timed


def _table(message: Any) -> NDArray[np.void]:
    """Return the points (n,) as records of their fields."""
    step, width, height = int(message.point_step), int(message.width), int(message.height)
    order = ">" if message.is_bigendian else "<"
    fields: dict[str, tuple[str, int]] = {}
    for field in message.fields:
        form = TYPES.get(int(field.datatype))
        if form is None or int(field.count) > 1:
            continue  # a vector, or of a kind that does not matter
        if int(field.offset) + np.dtype(form).itemsize > step:
            raise BadCloudError(f"its field {field.name} lies outside of its points of {step} bytes")
        fields[str(field.name)] = order + form, int(field.offset)
    data = np.ascontiguousarray(message.data, np.uint8)
    row = int(message.row_step) if height > 1 else step * width
    if step <= 0 or row < step * width or len(data) < row * (height - 1) + step * width:
        raise BadCloudError(f"{width} x {height} points of {step} bytes are not in its {len(data)} bytes")
    rows = [data[k * row : k * row + step * width] for k in range(height)] if height > 1 else [data]
    dense = np.concatenate(rows) if height > 1 else data[: step * width]
    kinds = np.dtype(
        {
            "names": list(fields),
            "formats": [form for form, _ in fields.values()],
            "offsets": [offset for _, offset in fields.values()],
            "itemsize": step,
        }
    )
    return np.frombuffer(dense.tobytes(), kinds)


def _stamps(table: NDArray[np.void], stamp_ns: int) -> NDArray[np.int64] | None:
    """Return the times of points (ns), None where there are none or they make no sense."""
    name = next((name for name in TIMES if name in (table.dtype.names or ())), None)
    if name is None or not len(table):
        return None
    values = table[name]
    if values.dtype.kind in "iu":
        values = values.astype(np.int64)
    scales: tuple[float, ...] = (1.0,) if values.dtype.kind == "i" else (1e9, 1.0)
    for scale in scales:
        for since_ns in (0, stamp_ns):
            with np.errstate(invalid="ignore", over="ignore"):
                scaled = (
                    values if scale == 1.0 and values.dtype.kind == "i" else values.astype(np.float64) * scale
                )
                away = scaled.astype(np.float64) + float(since_ns - stamp_ns)
            if np.isfinite(away).all() and (np.abs(away) < MOST_NS).all():
                return np.asarray(scaled).astype(np.int64) + since_ns
    return None


def _bytes(table: NDArray[np.void], wanted: tuple[str, ...]) -> NDArray[np.uint8]:
    """Return the first of the fields wanted as bytes, zero where there is none."""
    name = next((name for name in wanted if name in (table.dtype.names or ())), None)
    if name is None:
        return np.zeros(len(table), np.uint8)
    return np.clip(np.nan_to_num(table[name].astype(np.float64)), 0, 255).astype(np.uint8)
