"""Encoders of the IMU packets of Livox and Ouster LiDARs. Everything is little-endian.

Livox ("Livox LiDAR Communication Protocol - Mid360", v1.4.11, Point Cloud & IMU Data Protocol): the header of
`livox_packets` with data_type 0, dot_num 1, time_interval 0 and a counter of its own, sent from port 56400 to
56401 of the host, followed by 24 bytes; 60 bytes in all:

======  ======  ====  =====================
field   offset  size  meaning
======  ======  ====  =====================
gyro_x      36     4  float, rad/s
gyro_y      40     4  float, rad/s
gyro_z      44     4  float, rad/s
acc_x       48     4  float, g
acc_y       52     4  float, g
acc_z       56     4  float, g
======  ======  ====  =====================

Ouster (firmware manual, IMU data packet format, udp_profile_imu LEGACY), port 7503, 48 bytes:

==============  ======  ====  ==============================================
field           offset  size  meaning
==============  ======  ====  ==============================================
diagnostic time      0     8  ns since power-up, whatever the time source
accel read time      8     8  ns, by the sensor's clock
gyro read time      16     8  ns, by the sensor's clock
acceleration        24    12  three floats x, y, z, g
angular rate        36    12  three floats x, y, z, degrees per second
==============  ======  ====  ==============================================

Both state the specific force: at rest and upright z is +1 g.
"""

from __future__ import annotations

import struct

import numpy as np

from sitl.sensors.imu.inertial_unit import GRAVITY_MS2, InertialSamples
from sitl.sensors.livox_packets import encode_imu

_OUSTER = struct.Struct("<QQQ3f3f")


class LivoxInertialPackets:
    """Encoder of one Livox packet per sample."""

    def __init__(self) -> None:
        self._count = 0

    def encode(self, samples: InertialSamples) -> list[bytes]:
        out = []
        for stamp_ns, rate, force in zip(
            samples.stamp_ns.tolist(), samples.rate_rad_s, samples.force_ms2 / GRAVITY_MS2, strict=True
        ):
            out.append(encode_imu(stamp_ns, self._count, rate, force))
            self._count += 1
        return out


class OusterInertialPackets:
    """Encoder of one Ouster packet per sample."""

    def encode(self, samples: InertialSamples) -> list[bytes]:
        degrees, force = np.degrees(samples.rate_rad_s), samples.force_ms2 / GRAVITY_MS2
        return [
            _OUSTER.pack(stamp, stamp, stamp, *force[row].tolist(), *degrees[row].tolist())
            for row, stamp in enumerate(samples.stamp_ns.tolist())
        ]
