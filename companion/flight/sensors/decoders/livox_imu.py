"""Inertial samples of a Mid-360 (Livox LiDAR communication protocol for the Mid-360, data type 0).

The packet has the header of a point packet. A sample is six floats, little endian: rates about x, y, z in
rad/s, then specific force along x, y, z in g. By the user manual the unit's axes are those of the points,
and its position among them is x = 11.0, y = 23.29, z = -44.12 mm. The sensor sends one sample a packet, 200
a second.
"""

from __future__ import annotations

import numpy as np

from companion.flight.sensors.imu_samples import STANDARD_GRAVITY_MS2, ImuSamples

DATA_TYPE = 0
SAMPLE_BYTES = 24
LEVER_M = (0.011, 0.02329, -0.04412)


def decode_samples(body: bytes, stamp_ns: int, interval_ns: int) -> ImuSamples:
    """Return the samples of a packet's body.

    Parameters
    ----------
    body
        Whole samples, at least one.
    stamp_ns, interval_ns
        Time of the first sample on the sensor's clock, and time from the first to the last.
    """
    with np.errstate(invalid="ignore"):  # NaN that signals
        values = np.frombuffer(body, "<f4").reshape(-1, 6).astype(np.float64)
    steps = np.linspace(0, interval_ns, len(values)) if len(values) > 1 else np.zeros(1)
    return ImuSamples(
        stamp_ns + steps.astype(np.int64),
        values[:, :3],
        values[:, 3:] * STANDARD_GRAVITY_MS2,
        np.array(LEVER_M),
    )
