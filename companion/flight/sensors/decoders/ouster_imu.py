"""Inertial samples of Ouster's OS0, OS1 and OS2 (firmware manual, IMU data packet format).

Profile LEGACY: 48 bytes, little endian: time since power-up, time of the accelerometer's reading, time of the
gyroscope's reading (uint64, ns; the last two on the clock of the points), specific force along x, y, z in g,
rates about x, y, z in degrees per second (float32). About 100 Hz, or 128 Hz by model.

Profile ACCEL32_GYRO32_NMEA: a header of 32 bytes that begins with the packet type 2 (uint16), a block of 100
bytes with the time and text of an NMEA message, measurements of 36 bytes, and a footer of 32 bytes. A
measurement is a stamp (uint64, ns), its number in the frame (uint16), a status (uint16) whose lowest bit
means valid, specific force in m/s2 and rates in rad/s (3 float32 each). These units are those of a recording
of firmware 3.2, whose steps are the unit's 1/2048 g and 1/16.4 degree per second, and which measures 9.88 at
rest; a comment in the maker's SDK names g and degrees per second.

`imu_to_sensor_transform` of the metadata rotates the unit's axes into the sensor frame, that of the points,
and holds the unit's position in mm.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from companion.flight.sensors.imu_samples import STANDARD_GRAVITY_MS2, ImuSamples

LEGACY_BYTES = 48
IMU_TYPE = 2
FIRST_MEASUREMENT, FOOTER_BYTES = 32 + 100, 32
MOST_NS = 2**62
ROUNDING = 1e-3  # of a rotation matrix in the metadata

_LEGACY = np.dtype(
    [("on", "<u8"), ("force_ns", "<u8"), ("stamp_ns", "<u8"), ("force", "<f4", 3), ("rate", "<f4", 3)]
)
_MEASUREMENT = np.dtype(
    [
        ("stamp_ns", "<u8"),
        ("number", "<u2"),
        ("status", "<u2"),
        ("force", "<f4", 3),
        ("rate", "<f4", 3),
    ]
)


class OusterImu:
    """Decoder of one sensor's inertial packets.

    Parameters
    ----------
    size
        Bytes of a packet by the metadata; 0 if the sensor sends none.
    sensor_from_imu
        (4, 4), `imu_to_sensor_transform`, with its position in mm.

    Attributes
    ----------
    is_placed
        Whether the transform is rigid; without one no sample is decoded.
    """

    def __init__(self, size: int, sensor_from_imu: ArrayLike) -> None:
        transform = np.asarray(sensor_from_imu, np.float64).reshape(4, 4)
        self.size = size
        self._rotation = np.ascontiguousarray(transform[:3, :3])
        self._lever_m = transform[:3, 3] * 1e-3
        self.is_placed = bool(
            np.isfinite(transform).all()
            and np.allclose(self._rotation @ self._rotation.T, np.eye(3), atol=ROUNDING)
            and np.linalg.det(self._rotation) > 0
        )

    def decode(self, packet: bytes) -> ImuSamples | None:
        """Return the valid samples of a packet of `size` bytes; None if it is malformed."""
        if self.size == LEGACY_BYTES:
            rows = np.frombuffer(packet, _LEGACY)
            rate, force = np.pi / 180, STANDARD_GRAVITY_MS2
        elif int.from_bytes(packet[:2], "little") != IMU_TYPE:
            return None
        else:
            rows = np.frombuffer(packet[FIRST_MEASUREMENT:-FOOTER_BYTES], _MEASUREMENT)
            rows = rows[rows["status"] & 1 == 1]
            rate = force = 1.0
        if (rows["stamp_ns"] > MOST_NS).any():
            return None
        stamp_ns = rows["stamp_ns"].astype(np.int64)
        if (np.diff(stamp_ns) <= 0).any():
            return None
        samples = ImuSamples(
            stamp_ns,
            self._turned(rows["rate"]) * rate,
            self._turned(rows["force"]) * force,
            self._lever_m.copy(),
        )
        return samples if samples.is_plausible else None

    def _turned(self, vectors: NDArray[np.float32]) -> NDArray[np.float64]:
        """Return vectors (n, 3) of the unit in the axes of the points."""
        with np.errstate(all="ignore"):  # NaN and infinity
            return np.asarray(vectors, np.float64) @ self._rotation.T
