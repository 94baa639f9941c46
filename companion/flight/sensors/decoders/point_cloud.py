"""Decoding of recorded clouds (sensor_msgs/PointCloud2 and similar records) into batches of returns."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from itertools import islice
from typing import Any

import numpy as np
from numpy.typing import NDArray

from companion.flight.sensors.decoders.point_clock import PointClock, Sample, infer_clock, sample
from companion.flight.sensors.returns import Returns

# PointField.datatype
TYPES = {1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 8: "f8"}
# Names of a point's time in drivers: Velodyne, Ouster, Hesai and RoboSense, Livox, Nebula.
TIMES = ("time", "t", "timestamp", "offset_time", "time_stamp", "time_offset")
INTENSITIES = ("intensity", "reflectivity")
RINGS = ("ring", "line", "channel")
ECHOES = (("return_number",), ("number_of_returns", "num_returns"))
JUDGED, LOOKED_AT = 50, 500  # clouds examined at most: with times, and all

Table = NDArray[np.void]


class BadCloudError(ValueError):
    """A point cloud that contradicts itself, and how."""


@dataclass(frozen=True, slots=True)
class StampedCloud:
    """A recorded cloud.

    stamp_ns: of its message, since 1970. frame: name of the frame of its points. table: (n,) records.
    doubtful: number of points left out because the sensor flags them.
    """

    stamp_ns: int
    frame: str
    table: Table
    doubtful: int = 0


@dataclass(frozen=True, slots=True)
class Decoded:
    """Returns of a cloud in time order.

    timed: they have times of their own; else all have the cloud's stamp. no_return: number of points
    without a measurement, left out. false_times: number of returns left out because their time is far from
    the cloud's.
    """

    returns: Returns
    timed: bool
    no_return: int
    false_times: int


def decode(table: Table, stamp_ns: int, clock: PointClock | None) -> Decoded:
    """Return the returns of a cloud.

    Parameters
    ----------
    table
        (n,) records with the fields x, y, z (m) and any of `TIMES`, `INTENSITIES`, `RINGS` and
        `ECHOES`. Intensities keep the file's scale.
    stamp_ns
        The cloud's.
    clock
        Meaning of the points' times; None if they have no usable times.
    """
    xyz = coordinates(table)
    real = is_return(xyz)
    n_absent = int(np.count_nonzero(~real))
    if n_absent:
        table, xyz = table[real], xyz[real]
    timed = None
    if clock is not None and clock.field in (table.dtype.names or ()):
        timed = clock.stamps(table[clock.field], stamp_ns)
    stamps, sound = timed or (np.full(len(table), stamp_ns, np.int64), np.ones(len(table), bool))
    order = np.argsort(stamps, kind="stable")
    order = order[sound[order]]
    intensity = _intensity(table)[order]
    ring, echo, echoes = (_bytes(table, names)[order] for names in (RINGS, *ECHOES))
    returns = Returns(xyz[order], stamps[order], intensity, ring, echo, echoes)
    return Decoded(returns, timed is not None, n_absent, len(table) - len(order))


def clock_of(clouds: Iterable[StampedCloud]) -> PointClock | str:
    """Return the clock of the points' times, from a recording's first clouds, or the reason there is none."""
    samples: dict[str, list[Sample]] = {}
    stamps_ns: list[int] = []
    for cloud in islice(clouds, LOOKED_AT):
        names = cloud.table.dtype.names or ()
        stamps_ns.append(cloud.stamp_ns)
        real = is_return(coordinates(cloud.table))
        for name in TIMES:
            found = sample(cloud.table[name][real], cloud.stamp_ns) if name in names else None
            if found is not None:
                samples.setdefault(name, []).append(found)
        if max(map(len, samples.values()), default=0) >= JUDGED:
            break
    verdicts = [infer_clock(name, samples[name], stamps_ns) for name in TIMES if name in samples]
    known = (verdict for verdict in verdicts if isinstance(verdict, PointClock))
    return next(known, verdicts[0] if verdicts else "the points have no times")


def coordinates(table: Table) -> NDArray[np.float32]:
    """Return (n, 3) coordinates of records."""
    xyz = np.empty((len(table), 3), np.float32)
    with np.errstate(invalid="ignore", over="ignore"):
        for k, name in enumerate("xyz"):
            xyz[:, k] = table[name]
    return xyz


def is_return(xyz: NDArray[np.float32]) -> NDArray[np.bool_]:
    """Return the mask of measured points, of (n, 3): drivers write NaN or zeros for no return."""
    with np.errstate(invalid="ignore"):  # a signalling NaN
        return np.asarray(np.isfinite(xyz).all(axis=1) & xyz.any(axis=1))


def table_of(message: Any) -> Table:
    """Return the points (n,) of a sensor_msgs/PointCloud2 as records of their fields.

    Raises
    ------
    BadCloudError
        A field is missing or outside of the point, or data are missing.
    """
    step, width, height = int(message.point_step), int(message.width), int(message.height)
    order = ">" if message.is_bigendian else "<"
    fields: dict[str, tuple[str, int]] = {}
    for field in message.fields:
        form = TYPES.get(int(field.datatype))
        if form is None or int(field.count) > 1:
            continue  # a vector, or of an unused type
        if int(field.offset) + np.dtype(form).itemsize > step:
            raise BadCloudError(f"its field {field.name} lies outside of its points of {step} bytes")
        fields[str(field.name)] = order + form, int(field.offset)
    missing = [name for name in "xyz" if name not in fields]
    if missing:
        raise BadCloudError(f"it has no {' and no '.join(missing)}")
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


def _field(table: Table, wanted: tuple[str, ...]) -> NDArray[Any] | None:
    """Return the first present field of `wanted`."""
    name = next((name for name in wanted if name in (table.dtype.names or ())), None)
    return None if name is None else table[name]


def _intensity(table: Table) -> NDArray[np.uint8] | NDArray[np.float32]:
    """Return intensities in the file's scale, NaN where there is none."""
    found = _field(table, INTENSITIES)
    if found is None:
        return np.full(len(table), np.nan, np.float32)
    if found.dtype == np.uint8:
        return found
    with np.errstate(invalid="ignore", over="ignore"):
        return np.maximum(found.astype(np.float32), np.float32(0))


def _bytes(table: Table, wanted: tuple[str, ...]) -> NDArray[np.uint8]:
    """Return the first present field of `wanted` as bytes, zero where there is none."""
    found = _field(table, wanted)
    if found is None:
        return np.zeros(len(table), np.uint8)
    return np.clip(np.nan_to_num(found.astype(np.float64)), 0, 255).astype(np.uint8)
