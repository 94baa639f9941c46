"""Feed of a ROS bag: its clouds and its poses."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial
from itertools import islice
from pathlib import Path
from typing import Any

from companion.desk.replay.cloud_folder import CloudCounts
from companion.desk.replay.foreign_replay import Act, Rerun
from companion.desk.replay.ros.bag_file import CLOUDS, BagFile
from companion.desk.replay.ros.ros_pose import GlobalPoses, LocalPoses
from companion.desk.replay.ros.topic_clocks import false_stamps
from companion.flight.sensors.decoders.point_clock import PointClock
from companion.flight.sensors.decoders.point_cloud import LOOKED_AT, StampedCloud, clock_of, decode
from companion.runtime.errors import UsageError

FIX, IMU = "sensor_msgs/msg/NavSatFix", "sensor_msgs/msg/Imu"
LOCAL = (
    "nav_msgs/msg/Odometry",
    "geometry_msgs/msg/PoseStamped",
    "geometry_msgs/msg/PoseWithCovarianceStamped",
)
# Raised by a message whose definition in the bag is damaged or not that of its type.
MISSHAPEN = (AttributeError, ValueError, TypeError, OverflowError, IndexError)
LEVEL_MOUNT = {f"lidar_{name}": 0.0 for name in ("x_m", "y_m", "z_m", "roll_deg", "pitch_deg", "yaw_deg")}


class RosFeed:
    """Feed of a flight from a bag.

    Parameters
    ----------
    points
        Topic of the clouds; None selects the only one.
    poses
        Topic of the poses, or of fixes and of orientations; none selects the only ones.

    Attributes
    ----------
    is_local
        Poses are metres from an origin that the bag does not state.
    body_points
        The points are in the body's axes already, according to the names of their frames.

    Raises
    ------
    UsageError
        The bag cannot be read, or the topics are absent, ambiguous or of another type.
    """

    def __init__(self, path: Path, points: str | None, poses: Sequence[str]) -> None:
        self._path = path
        self._bag = BagFile(path)
        self._bad = 0
        self._counts = CloudCounts()
        types = self._bag.types
        self._points = _points_topic(path, types, points)
        self._poses = _pose_topics(path, types, poses)
        self.is_local = types[self._poses[0]] in LOCAL
        self._unstamped = [topic for topic in (self._points, *self._poses) if not self._has_stamps(topic)]
        self._without_stamp = self._false_stamps = 0
        self.body_points = self._compare_frames()
        self._contradicting = false_stamps(path, self._times())
        self._clock = clock_of(message for *_, message in self._messages((self._points,)))

    @property
    def cut(self) -> str:
        return self._bag.cut

    @property
    def bad(self) -> int:
        return self._bad + self._bag.bad

    def summary(self) -> dict[str, Any]:
        stamps = {"stamped_by_recorder": self._unstamped, "messages_without_stamp": self._without_stamp}
        stamps["messages_with_false_stamp"] = self._false_stamps
        topics = {"points": self._points, "poses": list(self._poses)}
        return topics | stamps | self._counts.summary(self._clock)

    def steps(self, rerun: Rerun) -> Iterator[tuple[int, Act]]:
        poses = (LocalPoses if self.is_local else GlobalPoses)(rerun.history)
        self._bad, at_ns, self._counts = 0, 0, CloudCounts()
        for at_ns, stamp_ns, topic, message in self._messages((self._points, *self._poses)):
            if topic == self._points:
                yield at_ns, partial(self._cloud, message, rerun)
            else:
                yield at_ns, partial(self._pose, message, stamp_ns, poses)
        self._bad += poses.refused
        yield at_ns, poses.finish

    def _has_stamps(self, topic: str) -> bool:
        messages = islice(self._bag.messages((topic,)), LOOKED_AT)
        return any(stamp_ns for _, stamp_ns, *_ in messages)

    def _messages(self, topics: Sequence[str]) -> Iterator[tuple[int, int, str, Any]]:
        """Yield the messages of the bag that have a time: the recorder's where a topic has no other."""
        self._without_stamp = self._false_stamps = 0
        for at_ns, told_ns, topic, message in self._bag.messages(topics):
            stamp_ns = self._stamp_ns(topic, at_ns, told_ns)
            if not stamp_ns:
                self._without_stamp += 1
                continue
            if (at_ns, stamp_ns) in self._contradicting[topic]:
                self._false_stamps += 1
                continue
            if isinstance(message, StampedCloud):
                message = replace(message, stamp_ns=stamp_ns)
            yield at_ns, stamp_ns, topic, message

    def _stamp_ns(self, topic: str, at_ns: int, told_ns: int) -> int:
        return told_ns or (at_ns if topic in self._unstamped else 0)

    def _times(self) -> Mapping[str, Sequence[tuple[int, int]]]:
        """Return times of recording and stamps of each topic's messages that have one."""
        found: dict[str, list[tuple[int, int]]] = {topic: [] for topic in (self._points, *self._poses)}
        for at_ns, told_ns, topic in self._bag.times(tuple(found)):
            stamp_ns = self._stamp_ns(topic, at_ns, told_ns)
            if stamp_ns:
                found[topic].append((at_ns, stamp_ns))
        return found

    def _cloud(self, cloud: StampedCloud, rerun: Rerun) -> None:
        clock = self._clock if isinstance(self._clock, PointClock) else None
        decoded = decode(cloud.table, cloud.stamp_ns, clock)
        if self._counts.add(decoded, clock, cloud.doubtful):
            rerun.add_returns(decoded.returns)

    def _pose(self, message: Any, stamp_ns: int, poses: LocalPoses | GlobalPoses) -> None:
        try:
            poses.add_message(message, stamp_ns)
        except MISSHAPEN:
            self._bad += 1

    def _compare_frames(self) -> bool:
        """Return whether points are in the body's axes; refuse points that are georeferenced already."""
        cloud = next(iter(self._bag.messages((self._points,))), None)
        pose = next(iter(self._bag.messages(self._poses[:1])), None)
        if cloud is None or pose is None:
            empty = self._points if cloud is None else self._poses[0]
            raise UsageError(f"{self._path}: no message on {empty} can be read")
        frame, parent = cloud[3].frame, getattr(pose[3].header, "frame_id", "")
        if self.is_local and frame and frame == parent:
            raise UsageError(
                f"{self._path}: points on {self._points} are in the frame {frame!r} of the poses, so placed"
                " already: name the sensor's own by --points"
            )
        return bool(frame) and frame == getattr(pose[3], "child_frame_id", "")


def _points_topic(path: Path, types: dict[str, str], given: str | None) -> str:
    clouds = sorted(name for name, kind in types.items() if kind in CLOUDS)
    if given is not None:
        return _checked(path, types, given, CLOUDS, "--points")
    if not clouds:
        raise UsageError(f"{path}: it has no message of sensor_msgs/PointCloud2, nor of Livox's CustomMsg")
    if len(clouds) > 1:
        raise UsageError(f"{path}: topics of clouds are {', '.join(clouds)[:150]}: name one by --points")
    return clouds[0]


def _pose_topics(path: Path, types: dict[str, str], given: Sequence[str]) -> tuple[str, ...]:
    if given:
        for topic in given:
            _checked(path, types, topic, (*LOCAL, FIX, IMU), "--pose")
        kinds = [types[topic] for topic in given]
        if len(given) == 1 and kinds[0] in LOCAL:
            return tuple(given)
        if sorted(kinds) == sorted((FIX, IMU)):
            return tuple(sorted(given, key=lambda topic: types[topic] != FIX))
        raise UsageError(f"{path}: --pose takes one topic of poses, or one of NavSatFix and one of Imu")
    local = sorted(name for name, kind in types.items() if kind in LOCAL)
    fixes, imus = ([name for name, kind in types.items() if kind == wanted] for wanted in (FIX, IMU))
    if len(local) == 1:
        return (local[0],)
    if not local and len(fixes) == len(imus) == 1:
        return fixes[0], imus[0]
    found = sorted([*local, *fixes, *imus])
    if not found:
        raise UsageError(f"{path}: it has no message of a pose, nor of NavSatFix and Imu")
    raise UsageError(
        f"{path}: topics of poses are {', '.join(found)[:120]}: name one, or a NavSatFix and an Imu,"
        " by --pose"
    )


def _checked(path: Path, types: dict[str, str], topic: str, allowed: Sequence[str], option: str) -> str:
    if topic not in types:
        raise UsageError(f"{path}: no message is on {topic}; it has {', '.join(sorted(types))[:150]}")
    if types[topic] not in allowed:
        raise UsageError(f"{path}: {topic} is of {types[topic]}, which {option} does not take")
    return topic
