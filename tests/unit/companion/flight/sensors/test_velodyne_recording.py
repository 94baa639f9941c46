"""Packets of a real VLP-16 against the cloud of another decoder (nebula)."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray
from rosbags.rosbag2 import Reader
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from companion.flight.sensors.decoders.velodyne_decoder import VelodyneDecoder
from companion.flight.sensors.returns import RawReturns
from tests.unit.companion.flight.sensors.recordings import recording

CLOUD = np.dtype(
    [
        ("xyz", "<f4", 3),
        ("intensity", "u1"),
        ("return_type", "u1"),
        ("channel", "<u2"),
        ("azimuth", "<f4"),
        ("elevation", "<f4"),
        ("distance", "<f4"),
        ("stamp", "<u4"),
    ]
)
# The manual's vertical corrections (mm) of the 16 rings from the lowest up; the reference leaves them out.
UP_MM = np.array([11.2, 9.7, 8.1, 6.6, 5.1, 3.7, 2.2, 0.7, -0.7, -2.2, -3.7, -5.1, -6.6, -8.1, -9.7, -11.2])
# Return types of the reference: alone, or the first or last of two, each named by which of the two is strong.
ALONE, FIRST, SECOND = (6,), (5, 10), (4, 9)


@pytest.fixture(scope="module")
def packets() -> list[bytes]:
    types = get_types_from_msg(
        "builtin_interfaces/Time stamp\nuint8[1206] data\n", "velodyne_msgs/msg/VelodynePacket"
    ) | get_types_from_msg(
        "std_msgs/Header header\nvelodyne_msgs/VelodynePacket[] packets\n", "velodyne_msgs/msg/VelodyneScan"
    )
    store = get_typestore(Stores.ROS2_HUMBLE)
    store.register(types)
    with Reader(recording("velodyne_vlp16")) as reader:
        scans = [store.deserialize_cdr(raw, c.msgtype) for c, _, raw in reader.messages()]
    return [bytes(packet.data) for scan in scans for packet in scan.packets]


@pytest.fixture(scope="module")
def reference() -> NDArray[np.void]:
    data = recording("velodyne_vlp16/1673400472138016708.pcd").read_bytes()
    return np.frombuffer(data.split(b"DATA binary\n", 1)[1], CLOUD)


def azimuth_deg(xyz: NDArray[np.float32]) -> NDArray[np.float64]:
    return np.degrees(np.arctan2(-xyz[:, 1].astype(float), xyz[:, 0])) % 360


def last_turn(raw: RawReturns) -> NDArray[np.int64]:
    """Return the points of the last whole turn within the azimuths that the reference kept (deg)."""
    azimuth = azimuth_deg(raw.xyz_m)
    turns = np.nonzero(np.diff(azimuth) < -300)[0] + 1
    span = np.arange(turns[-2], turns[-1])
    return span[(azimuth[span] > 0.3) & (azimuth[span] < 359.0)]


def test_every_packet_of_the_recording_is_sound_and_none_is_lost(packets: list[bytes]) -> None:
    decoder = VelodyneDecoder()
    raw = decoder.decode(packets)
    c = decoder.counters
    assert (c.packets, c.malformed, c.lost_packets, c.returns) == (603, 0, 0, 59_414)
    assert raw.stamp_ns[-1] - raw.stamp_ns[0] == pytest.approx(400e6, rel=1e-3)


def test_the_points_are_those_of_the_reference(packets: list[bytes], reference: NDArray[np.void]) -> None:
    """Same points, and within 2 cm at the same azimuth.

    Every ray is the same to the last bit: channel, distance, intensity and number of the return. The cloud
    differs by the vertical correction, at most 11 mm, and for a sixth of the points by the azimuth, which the
    reference carries on between blocks in another way, by up to 0.4 degrees. The rest of the recording is of
    other turns, or out of the reference's azimuths.
    """
    raw = VelodyneDecoder().decode(packets)
    turn = last_turn(raw)
    assert len(turn) == len(reference) == 14_831
    xyz, ring = raw.xyz_m[turn].astype(float), raw.ring[turn]
    centred = xyz - np.column_stack([np.zeros((len(turn), 2)), UP_MM[ring] / 1000])
    ours_2mm = np.linalg.norm(centred, axis=1) / 0.002
    distance = np.rint(ours_2mm).astype(int)
    np.testing.assert_allclose(ours_2mm, distance, atol=0.01)
    theirs_2mm = np.rint(reference["distance"] / 0.002).astype(int)

    azimuth, other_azimuth = azimuth_deg(xyz), azimuth_deg(reference["xyz"])
    mine = np.lexsort((azimuth, distance, ring))
    other = np.lexsort((other_azimuth, theirs_2mm, reference["channel"]))
    np.testing.assert_array_equal(ring[mine], reference["channel"][other])
    np.testing.assert_array_equal(distance[mine], theirs_2mm[other])
    np.testing.assert_array_equal(raw.intensity[turn][mine], reference["intensity"][other])
    kind, echo, echoes = reference["return_type"][other], raw.echo[turn][mine], raw.echoes[turn][mine]
    np.testing.assert_array_equal(np.isin(kind, ALONE), echoes == 1)
    np.testing.assert_array_equal(np.isin(kind, SECOND), echo == 2)
    assert np.isin(kind, ALONE + FIRST + SECOND).all()

    turned = np.abs((azimuth[mine] - other_azimuth[other] + 180) % 360 - 180)
    apart_m = np.linalg.norm(xyz[mine] - reference["xyz"][other], axis=1)
    same = turned < 0.015
    assert same.mean() > 0.8
    assert turned.max() < 0.41
    assert apart_m[same].max() < 0.012
    # Elsewhere nothing but the azimuth differs.
    across_m = np.hypot(*xyz[mine][:, :2].T)
    assert (apart_m < 0.012 + np.radians(turned) * across_m).all()
