"""Points of Velodyne packets against those of the library `velodyne-decoder`."""

from __future__ import annotations

import numpy as np
import pytest
from velodyne_decoder import Config, Model, PacketVector, ScanDecoder, VelodynePacket
from velodyne_decoder.velodyne_decoder_pylib import TimePair

from companion.flight.sensors.decoders.velodyne_decoder import VelodyneDecoder
from tests.unit.companion.flight.sensors.velodyne_packets import (
    DUAL,
    HI_RES,
    SINGLE,
    VLP16,
    VLP32C,
    velodyne_packet,
)

MODELS = {VLP16: Model.VLP16, HI_RES: Model.PuckHiRes, VLP32C: Model.VLP32C}
LAST, STRONGEST = 2, 1
PACKET_S = 1 / 512


def packets(model: int, mode: int, seed: int) -> list[bytes]:
    """Random distances, a quarter of them none; in dual mode some rays give the same return twice."""
    rng = np.random.default_rng(seed)
    made = []
    for k in range(20):
        distance = rng.integers(200, 65_536, (12, 32)) * (rng.random((12, 32)) > 0.25)
        if mode == DUAL:
            again = rng.random((6, 32)) < 0.3
            distance[1::2][again] = distance[0::2][again]
        bright = rng.integers(0, 256, (12, 32))
        made.append(
            velodyne_packet(
                lambda block, place, d=distance, b=bright: (int(d[block, place]), int(b[block, place])),
                azimuth=(35_700 + 480 * k) % 36_000, stamp_us=1_000_000 + 1_327 * k, model=model, mode=mode,
            )
        )  # fmt: skip
    return made


@pytest.mark.parametrize("model", [VLP16, HI_RES, VLP32C])
@pytest.mark.parametrize("mode", [SINGLE, DUAL])
def test_the_points_are_those_of_the_library(model: int, mode: int) -> None:
    given = packets(model, mode, seed=model + mode)
    library = ScanDecoder(
        Config(model=MODELS[model], min_range=0.0, max_range=300.0, timestamp_first_packet=True)
    )
    vector = PacketVector([VelodynePacket(TimePair(0.0, k * PACKET_S), list(p)) for k, p in enumerate(given)])
    _, cloud = library.decode(vector, as_pcl_structs=True)
    raw = VelodyneDecoder().decode(given)
    assert len(raw) == len(cloud) > 3_000
    theirs = np.column_stack([cloud[axis] for axis in "xyz"]).astype(float)
    far_m = np.linalg.norm(theirs, axis=1)
    # It rounds azimuths to 0.01 degrees, and takes the vertical offsets of the Hi-Res from a drawing.
    assert (np.linalg.norm(raw.xyz_m - theirs, axis=1) < 1.01e-4 * far_m + 5e-4).all()
    np.testing.assert_allclose(np.linalg.norm(raw.xyz_m.astype(float), axis=1), far_m, atol=5e-4)
    np.testing.assert_array_equal(raw.intensity, cloud["intensity"])
    np.testing.assert_array_equal(raw.ring, cloud["ring"])
    packet = np.floor(cloud["time"].astype(float) / PACKET_S).astype(int)
    after_ns = (cloud["time"].astype(float) - packet * PACKET_S) * 1e9
    np.testing.assert_allclose(
        raw.stamp_ns % 3_600_000_000_000 - 1_000_000_000 - 1_327_000 * packet, after_ns, atol=5
    )
    kind = cloud["return_type"]
    two = np.zeros(len(raw), bool)
    (first,) = np.nonzero(
        (kind[:-1] == LAST)
        & (kind[1:] == STRONGEST)
        & (raw.stamp_ns[:-1] == raw.stamp_ns[1:])
        & (raw.ring[:-1] == raw.ring[1:])
    )
    two[first] = two[first + 1] = True
    np.testing.assert_array_equal(raw.echoes, 1 + two)
    assert bool(two.any()) == (mode == DUAL)
    nearer = np.where(far_m[first] < far_m[first + 1], first, first + 1)
    assert (raw.echo[nearer] == 1).all()
    assert np.count_nonzero(raw.echo == 2) == len(first)
