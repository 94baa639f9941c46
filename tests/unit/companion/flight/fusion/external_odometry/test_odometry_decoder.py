"""Messages of nav_msgs/Odometry: poses, and the reason for each that is not used."""

from __future__ import annotations

import math

import numpy as np
import pytest

from companion.flight.fusion.external_odometry.external_pose import Drop, ExternalPose
from companion.flight.fusion.external_odometry.odometry_decoder import DEFAULT_M, DEFAULT_RAD, decode
from tests.unit.companion.flight.fusion.external_odometry.odometry_messages import GID, Told

AT_NS = 1_700_000_000_123_456_789
NOTHING = (0.0,) * 36


def covariance(*diagonal: float) -> tuple[float, ...]:
    return tuple(np.diag(diagonal).ravel().tolist())


def decoded(told: Told) -> ExternalPose:
    pose = decode(told.packet())
    assert isinstance(pose, ExternalPose)
    return pose


def test_a_pose_has_the_numbers_of_the_message() -> None:
    half = math.sqrt(0.5)
    pose = decoded(Told(AT_NS, (1.5, -2.0, 30.0), (0.0, 0.0, half, half), frame="camera_init", child="body"))
    assert pose.stamp_ns == AT_NS
    assert pose.position_m.tolist() == [1.5, -2.0, 30.0]
    np.testing.assert_allclose(pose.rotation @ [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], atol=1e-12)  # turned left
    assert pose.origin == ("camera_init", "body", GID.hex())
    assert np.diag(pose.covariance).tolist() == pytest.approx([0.02**2] * 3 + [0.005**2] * 3)
    assert pose.is_stated


def test_zeros_mean_that_the_covariance_is_unknown() -> None:
    pose = decoded(Told(AT_NS, covariance=NOTHING))
    assert np.diag(pose.covariance).tolist() == pytest.approx([DEFAULT_M**2] * 3 + [DEFAULT_RAD**2] * 3)
    assert not pose.is_stated
    of_place = decoded(Told(AT_NS, covariance=covariance(0.1, 0.1, 0.1, 0, 0, 0)))
    assert np.diag(of_place.covariance).tolist() == pytest.approx([0.1] * 3 + [DEFAULT_RAD**2] * 3)


@pytest.mark.parametrize(
    ("told", "reason"),
    [
        (Told(AT_NS, (math.nan, 0.0, 0.0)), Drop.NOT_FINITE),
        (Told(AT_NS, (0.0, math.inf, 0.0)), Drop.NOT_FINITE),
        (Told(AT_NS, (0.0, 0.0, 1e9)), Drop.NOT_FINITE),
        (Told(AT_NS, xyzw=(0.0, 0.0, math.nan, 1.0)), Drop.NOT_FINITE),
        (Told(AT_NS, xyzw=(0.0, 0.0, 0.0, 0.0)), Drop.NOT_UNIT),
        (Told(AT_NS, xyzw=(0.0, 0.0, 0.5, 1.0)), Drop.NOT_UNIT),
        (Told(AT_NS, covariance=(-1.0, *NOTHING[1:])), Drop.DISOWNED),
        (Told(AT_NS, covariance=(math.nan, *NOTHING[1:])), Drop.BAD_COVARIANCE),
        (Told(AT_NS, covariance=covariance(0.1, -0.1, 0.1, 0, 0, 0)), Drop.BAD_COVARIANCE),
        (Told(AT_NS, covariance=(0.1, 0.05, *covariance(0.1, 0.1, 0.1, 0, 0, 0)[2:])), Drop.BAD_COVARIANCE),
        (Told(AT_NS, covariance=covariance(0.01, 0.01, 1e6, 0.01, 0.01, 0.01)), Drop.UNSURE),
        (Told(AT_NS, covariance=covariance(0.01, 0.01, 0.01, 0.01, 0.01, 9.9)), Drop.UNSURE),
        (Told(0), Drop.MALFORMED),
    ],
)
def test_a_pose_that_is_none_has_its_reason(told: Told, reason: Drop) -> None:
    assert decode(told.packet()) is reason


@pytest.mark.parametrize(
    "packet",
    [
        b"",
        Told(AT_NS).payload(),
        Told(AT_NS).packet()[:-1],
        Told(AT_NS).attachment() + b"\0\1\0\0" + b"\xff" * 700,
        Told(AT_NS, frame="a" * 70_000).packet(),
    ],
)
def test_bytes_that_are_no_message_are_malformed(packet: bytes) -> None:
    assert decode(packet) is Drop.MALFORMED


def test_each_reason_has_a_counter_and_words_that_fit_a_text_to_the_pilot() -> None:
    assert len({reason.counter for reason in Drop}) == len(Drop)
    assert all(len(f"SLZ: odometry not used: {reason.words}") <= 50 for reason in Drop)
