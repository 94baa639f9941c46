"""Encoder of Ouster lidar data packets, and of the metadata that describes them (firmware manual, v2.5).

Profile RNG19_RFL8_SIG16_NIR16, and RNG19_RFL8_SIG16_NIR16_DUAL with two returns. Everything is little-endian.
A packet is a header of 32 bytes, 16 columns of one header of 12 bytes and `rows` pixels of 12 bytes, and a
footer of 32 bytes, zero:

==============  ======  ====  ===========================================================
field           offset  size  meaning
==============  ======  ====  ===========================================================
packet_type          0     2  1, lidar
frame_id             2     2  wraps around after 65535
init_id              4     3  changes at every setup of the sensor
serial_number        7     5
timestamp            0     8  of a column: time of its measurement, ns
measurement_id       8     2  of a column: its number in the frame
status              10     2  of a column: bit 0, valid
range                0     4  of a pixel: 19 bits, mm
reflectivity         4     1  of a pixel
signal               6     2  of a pixel: photons
near_ir              8     2  of a pixel: photons
==============  ======  ====  ===========================================================

A pixel with two returns has 16 bytes: range (19 bits) and reflectivity (byte 3) of the strongest return, the
same of the second strongest (from byte 4), both signals (bytes 8 and 10) and near_ir (byte 12).
"""

from __future__ import annotations

import json
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

F64 = NDArray[np.float64]
I64 = NDArray[np.int64]
U8 = NDArray[np.uint8]

PACKET_COLUMNS = 16
MOST_MM = (1 << 19) - 1
UP_MM = 36.18
PROFILE = "RNG19_RFL8_SIG16_NIR16"
PROFILE_DUAL = PROFILE + "_DUAL"
SERIAL, INIT_ID = 992_247_000_001, 7
PIXEL = np.dtype(
    {
        "names": ["range", "reflectivity", "signal", "near_ir"],
        "formats": ["<u4", "u1", "<u2", "<u2"],
        "offsets": [0, 4, 6, 8],
        "itemsize": 12,
    }
)
PIXEL_DUAL = np.dtype(
    {
        # Ranges and reflectivities overlap: 19 bits and the highest byte of one word.
        "names": ["range", "reflectivity", "range2", "reflectivity2", "signal", "signal2", "near_ir"],
        "formats": ["<u4", "u1", "<u4", "u1", "<u2", "<u2", "<u2"],
        "offsets": [0, 3, 4, 7, 8, 10, 12],
        "itemsize": 16,
    }
)


def packet_type(rows: int, dual: bool = False) -> np.dtype[np.void]:
    """Return the layout of a packet of a sensor with `rows` rows."""
    pixel = PIXEL_DUAL if dual else PIXEL
    column = [("timestamp", "<u8"), ("measurement_id", "<u2"), ("status", "<u2"), ("pixels", pixel, rows)]
    return np.dtype(
        [
            ("packet_type", "<u2"),
            ("frame_id", "<u2"),
            ("init_id", "u1", 3),
            ("serial_number", "u1", 5),
            ("reserved", "u1", 20),
            ("columns", column, PACKET_COLUMNS),
            ("footer", "u1", 32),
        ]
    )


def encode_packets(
    layout: np.dtype[np.void],
    first: I64,
    frame_columns: int,
    stamps_ns: I64,
    returns: Sequence[tuple[F64, U8]],
    valid: NDArray[np.bool_] | bool = True,
) -> list[bytes]:
    """Encode n packets.

    Parameters
    ----------
    layout
        See ``packet_type``.
    first, frame_columns
        (n,) number of the first column since power-up, and columns of a frame.
    stamps_ns
        (n, 16) of the columns.
    returns
        One or two (range in m, reflectivity), the strongest first, each (n, 16, rows) with the highest row
        first; a range of zero is no return.
    valid
        (n, 16), whether the columns were measured.
    """
    packets = np.zeros(len(first), layout)
    packets["packet_type"], packets["frame_id"] = 1, first // frame_columns % 65_536
    packets["init_id"] = list(INIT_ID.to_bytes(3, "little"))
    packets["serial_number"] = list(SERIAL.to_bytes(5, "little"))
    columns = packets["columns"]
    columns["timestamp"] = stamps_ns
    columns["measurement_id"] = (first % frame_columns)[:, np.newaxis] + np.arange(PACKET_COLUMNS)
    columns["status"] = valid
    for (range_m, reflectivity), suffix in zip(returns, ("", "2"), strict=False):
        mm = np.maximum(np.rint(range_m * 1000.0), 0)
        columns["pixels"][f"range{suffix}"] = np.where(mm > MOST_MM, 0, mm)
        columns["pixels"][f"reflectivity{suffix}"] = reflectivity
        columns["pixels"][f"signal{suffix}"] = 10 * reflectivity.astype(np.uint16)
    return [packet.tobytes() for packet in packets]


def metadata(elevation_deg: F64, columns: int, product: str = "OS-1", dual: bool = False) -> str:
    """Return the metadata as from the sensor's HTTP API, JSON.

    Its beams start on the axis of rotation (a real OS1's 12 to 16 mm from it), `UP_MM` above the base.
    """
    rows, profile = len(elevation_deg), PROFILE_DUAL if dual else PROFILE
    identity = [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]
    return json.dumps(
        {
            "sensor_info": {
                "prod_line": f"{product}-{rows}",
                "prod_sn": str(SERIAL),
                "prod_pn": "",
                "image_rev": "",
                "build_rev": "v2.5.3",
                "build_date": "",
                "status": "RUNNING",
                "initialization_id": INIT_ID,
            },
            "config_params": {"udp_profile_lidar": profile, "lidar_mode": f"{columns}x10"},
            "lidar_data_format": {
                "columns_per_frame": columns,
                "columns_per_packet": PACKET_COLUMNS,
                "pixels_per_column": rows,
                "pixel_shift_by_row": [0] * rows,
                "column_window": [0, columns - 1],
                "udp_profile_lidar": profile,
                "udp_profile_imu": "LEGACY",
                "fps": 10,
            },
            "beam_intrinsics": {
                "beam_altitude_angles": [float(angle) for angle in elevation_deg],
                "beam_azimuth_angles": [0.0] * rows,
                "lidar_origin_to_beam_origin_mm": 0.0,
                "beam_to_lidar_transform": identity,
            },
            "lidar_intrinsics": {
                "lidar_to_sensor_transform": [-1, 0, 0, 0, 0, -1, 0, 0, 0, 0, 1, UP_MM, 0, 0, 0, 1]
            },
            "imu_intrinsics": {"imu_to_sensor_transform": identity},
            "calibration_status": {},
        }
    )
