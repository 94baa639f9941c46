"""Ouster packets and metadata of a sensor of 16 rows, built field by field from the firmware manual."""

from __future__ import annotations

import json
import struct
from collections.abc import Callable
from importlib import import_module

ROWS, COLUMNS, PACKET_COLUMNS = 16, 512, 16
SINGLE, DUAL, LOW, LEGACY = (
    "RNG19_RFL8_SIG16_NIR16",
    "RNG19_RFL8_SIG16_NIR16_DUAL",
    "RNG15_RFL8_NIR8",
    "LEGACY",
)
NEW_IMU, IMU_ROWS = "ACCEL32_GYRO32_NMEA", 8
TOP_DEG, STEP_DEG = 45.0, 6.0
Measure = Callable[[int, int], tuple[int, int]]
"""Row from the top, column of the packet -> range in mm, reflectivity."""


def _missing() -> str:
    try:
        import_module("ouster.sdk._bindings.client")
    except ImportError as error:
        return f"ouster-sdk cannot be loaded: {error}"
    return ""


MISSING = _missing()
"""Why the package that reads packets cannot be used here, empty where it can."""


def nothing(_row: int, _column: int) -> tuple[int, int]:
    return 0, 0


def only(row: int, column: int, range_mm: int = 10_000, reflectivity: int = 77) -> Measure:
    """Return a measurement of one pixel alone."""
    return lambda r, c: (range_mm, reflectivity) if (r, c) == (row, column) else (0, 0)


LEVEL = (1, 0, 0, 6.253, 0, 1, 0, -11.775, 0, 0, 1, 7.645, 0, 0, 0, 1)


def metadata(
    profile: str = SINGLE, *, imu_profile: str = LEGACY, imu_to_sensor: tuple[float, ...] = LEVEL
) -> str:
    """Return the sensor's metadata; its beams lie 6 degrees apart, the highest at +45."""
    return json.dumps(
        {
            "sensor_info": {
                "prod_line": "OS-0-16",
                "prod_sn": "1",
                "prod_pn": "",
                "image_rev": "",
                "build_rev": "v2.5.3",
                "build_date": "",
                "status": "RUNNING",
                "initialization_id": 7,
            },
            "config_params": {"udp_profile_lidar": profile, "lidar_mode": f"{COLUMNS}x10"},
            "lidar_data_format": {
                "columns_per_frame": COLUMNS,
                "columns_per_packet": PACKET_COLUMNS,
                "pixels_per_column": ROWS,
                "pixel_shift_by_row": [0] * ROWS,
                "column_window": [0, COLUMNS - 1],
                "udp_profile_lidar": profile,
                "udp_profile_imu": imu_profile,
                "fps": 10,
            },
            "imu_data_format": {"imu_measurements_per_packet": IMU_ROWS, "imu_packets_per_frame": 8},
            "beam_intrinsics": {
                "beam_altitude_angles": [TOP_DEG - STEP_DEG * row for row in range(ROWS)],
                "beam_azimuth_angles": [0.0] * ROWS,
                "lidar_origin_to_beam_origin_mm": 0.0,
                "beam_to_lidar_transform": [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1],
            },
            "lidar_intrinsics": {
                "lidar_to_sensor_transform": [-1, 0, 0, 0, 0, -1, 0, 0, 0, 0, 1, 36, 0, 0, 0, 1]
            },
            "imu_intrinsics": {"imu_to_sensor_transform": list(imu_to_sensor)},
            "calibration_status": {},
        }
    )


def ouster_packet(
    measure: Measure = nothing,
    second: Measure = nothing,
    *,
    profile: str = SINGLE,
    stamp_ns: int = 5_000_000_000,
    column_ns: int = 195_312,
    frame: int = 3,
    column: int = 0,
    valid: bool = True,
    kind: int = 1,
) -> bytes:
    """Return a packet whose first column has this number and stamp; `second` are the second returns."""
    legacy = profile == LEGACY
    out = b"" if legacy else struct.pack("<HH28x", kind, frame)
    for c in range(PACKET_COLUMNS):
        stamp = (stamp_ns + c * column_ns) % 2**64
        if legacy:
            out += struct.pack("<QHHI", stamp, column + c, frame, 0)
        else:
            out += struct.pack("<QHH", stamp, column + c, valid)
        out += b"".join(_pixel(profile, *measure(row, c), *second(row, c)) for row in range(ROWS))
        if legacy:
            out += struct.pack("<I", 0xFFFFFFFF if valid else 0)
    return out if legacy else out + bytes(32)


def _pixel(profile: str, range_mm: int, bright: int, range2_mm: int, bright2: int) -> bytes:
    if profile == DUAL:
        return struct.pack("<II8x", range_mm | bright << 24, range2_mm | bright2 << 24)
    if profile == LOW:
        return struct.pack("<HBx", range_mm // 8, bright)
    return struct.pack("<IB7x", range_mm, bright)


def legacy_imu_packet(
    force_g: tuple[float, ...] = (0, 0, 1),
    rate_degs: tuple[float, ...] = (0, 0, 0),
    *,
    stamp_ns: int = 5_000_000_000,
) -> bytes:
    """Return an inertial packet of 48 bytes; the stamp is that of the gyroscope's reading."""
    return struct.pack("<QQQ6f", 77, max(0, stamp_ns - 222_770), stamp_ns, *force_g, *rate_degs)


def new_imu_packet(
    force_ms2: tuple[float, ...] = (0, 0, 9.8),
    rate_rads: tuple[float, ...] = (0, 0, 0),
    *,
    stamp_ns: int = 5_000_000_000,
    step_ns: int = 1_562_500,
    valid: tuple[int, ...] = (1,) * IMU_ROWS,
    kind: int = 2,
) -> bytes:
    """Return an inertial packet of the profile ACCEL32_GYRO32_NMEA."""
    out = struct.pack("<HH28x", kind, 3) + struct.pack("<Q92s", 1, b"$GPRMC")
    for k, status in enumerate(valid):
        out += struct.pack("<QHH6f", stamp_ns + k * step_ns, 32 * k, status, *force_ms2, *rate_rads)
    return out + bytes(32)
