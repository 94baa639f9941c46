"""Decoder of nav_msgs/Odometry (CDR) with rmw_zenoh's attachment before it."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from companion.flight.fusion.external_odometry.external_pose import Drop, ExternalPose
from companion.flight.rmw import attachment
from companion.flight.rmw.message_types import message_types

Floats = NDArray[np.float64]

ODOMETRY = "nav_msgs/msg/Odometry"
HEAD_BYTES = 33
MOST_BYTES = 1 << 16
MOST_NS = 2**62
MOST_M = 1e8  # coordinates of the Earth are below
QUATERNION_TOLERANCE = 0.01
# Standard deviations where the covariance is zero, which means unknown.
DEFAULT_M, DEFAULT_RAD = 0.05, np.radians(1.0)
# Largest standard deviations in use. Publishers write 1e6 and the like for what they do not observe.
MOST_SIGMA_M, MOST_SIGMA_RAD = 1.0, 0.5
UNKNOWN = -1.0


def decode(packet: bytes) -> ExternalPose | Drop:
    """Return the pose in a message, on the publisher's clock, or the reason why there is none.

    The twist is not read: many publishers leave it zero, and few state its axes reliably.
    """
    head = attachment.unpack(packet[:HEAD_BYTES])
    if head is None or len(packet) > MOST_BYTES:
        return Drop.MALFORMED
    try:
        message = message_types().deserialise(packet[HEAD_BYTES:], ODOMETRY)
        return _pose(message, head.gid.hex())
    except Exception:  # the library's generated code may raise anything
        return Drop.MALFORMED


def _pose(message: Any, publisher: str) -> ExternalPose | Drop:
    stamp, pose = message.header.stamp, message.pose.pose
    stamp_ns = int(stamp.sec) * 1_000_000_000 + int(stamp.nanosec)
    if not 0 < stamp_ns < MOST_NS:
        return Drop.MALFORMED
    position = np.array([pose.position.x, pose.position.y, pose.position.z])
    turn = pose.orientation
    quaternion = np.array([turn.x, turn.y, turn.z, turn.w])
    if not (np.abs(position) < MOST_M).all() or not np.isfinite(quaternion).all():
        return Drop.NOT_FINITE
    if abs(float(np.linalg.norm(quaternion)) - 1) > QUATERNION_TOLERANCE:
        return Drop.NOT_UNIT
    stated = np.asarray(message.pose.covariance, np.float64).reshape(6, 6)
    covariance = _covariance(stated)
    if isinstance(covariance, Drop):
        return covariance
    return ExternalPose(
        stamp_ns,
        position,
        np.asarray(Rotation.from_quat(quaternion).as_matrix()),
        covariance,
        bool(np.diagonal(stated)[:3].all()),
        str(message.header.frame_id),
        str(message.child_frame_id),
        publisher,
    )


def _covariance(stated: Floats) -> Floats | Drop:
    """Return the covariance with the defaults for what is not stated."""
    if stated[0, 0] == UNKNOWN:
        return Drop.DISOWNED
    if not np.isfinite(stated).all():
        return Drop.BAD_COVARIANCE
    scale = float(np.abs(stated).max())
    if not np.allclose(stated, stated.T, rtol=0, atol=1e-6 * scale):
        return Drop.BAD_COVARIANCE
    if float(np.linalg.eigvalsh(stated)[0]) < -1e-6 * scale:
        return Drop.BAD_COVARIANCE
    defaults = np.array([DEFAULT_M**2] * 3 + [DEFAULT_RAD**2] * 3)
    covariance: Floats = stated + np.diag(np.where(np.diagonal(stated) == 0, defaults, 0.0))
    away, turn = (float(np.linalg.eigvalsh(block)[-1]) for block in (covariance[:3, :3], covariance[3:, 3:]))
    if away > MOST_SIGMA_M**2 or turn > MOST_SIGMA_RAD**2:
        return Drop.UNSURE
    return covariance
