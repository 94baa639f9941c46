"""ROS 2 bags (a folder, .db3 or .mcap) and ROS 1 bags (.bag), by the library rosbags."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import Any

from companion.errors import UsageError
from companion.replay.point_cloud import BadCloudError, decode
from companion.replay.rerun import Act, Rerun
from companion.replay.ros_pose import GlobalPoses, LocalPoses

CLOUD, FIX, IMU = "sensor_msgs/msg/PointCloud2", "sensor_msgs/msg/NavSatFix", "sensor_msgs/msg/Imu"
LOCAL = (
    "nav_msgs/msg/Odometry",
    "geometry_msgs/msg/PoseStamped",
    "geometry_msgs/msg/PoseWithCovarianceStamped",
)
# What a message raises whose definition, stored in the bag, is damaged or not that of its type.
MISSHAPEN = (AttributeError, ValueError, TypeError, OverflowError, IndexError)
LEVEL_MOUNT = {f"lidar_{name}": 0.0 for name in ("x_m", "y_m", "z_m", "roll_deg", "pitch_deg", "yaw_deg")}


class RosFeed:
    """A flight from a bag.

    Parameters
    ----------
    points
        Topic of the clouds; None takes the only one.
    poses
        Topic of the poses, or of fixes and of orientations; none takes the only ones.

    Attributes
    ----------
    is_local
        Poses are metres from an origin that the bag does not tell.
    body_points
        The points are in the axes of the body already, by the names of their frames.

    Raises
    ------
    UsageError
        The bag cannot be read, or the topics are not there, not told or of another type.
    """

    def __init__(self, path: Path, points: str | None, poses: Sequence[str]) -> None:
        self._path = path
        self.cut = ""
        self.bad = 0
        self._n_untimed = self._n_clouds = 0
        with self._opened() as reader:
            types = {name: info.msgtype or "" for name, info in reader.topics.items() if info.msgcount}
        self._points = _points_topic(path, types, points)
        self._poses = _pose_topics(path, types, poses)
        self.is_local = types[self._poses[0]] in LOCAL
        self.body_points = self._compare_frames()

    def told(self) -> dict[str, Any]:
        return {
            "points": self._points,
            "poses": list(self._poses),
            "clouds": self._n_clouds,
            "clouds_without_point_times": self._n_untimed,
        }

    def steps(self, rerun: Rerun) -> Iterator[tuple[int, Act]]:
        poses = (LocalPoses if self.is_local else GlobalPoses)(rerun.history)
        self.bad, self.cut, at_ns = 0, "", 0
        for at_ns, stamp_ns, topic, message in self._messages((self._points, *self._poses)):
            if topic == self._points:
                yield at_ns, partial(self._cloud, message, stamp_ns, rerun)
            else:
                yield at_ns, partial(self._pose, message, stamp_ns, poses)
        self.bad += poses.refused
        yield at_ns, poses.finish

    def _cloud(self, message: Any, stamp_ns: int, rerun: Rerun) -> None:
        try:
            returns, timed = decode(message, stamp_ns)
        except (BadCloudError, *MISSHAPEN):
            self.bad += 1
            return
        self._n_clouds += 1
        self._n_untimed += not timed
        rerun.add_returns(returns)

    def _pose(self, message: Any, stamp_ns: int, poses: LocalPoses | GlobalPoses) -> None:
        try:
            poses.take(message, stamp_ns)
        except MISSHAPEN:
            self.bad += 1

    def _compare_frames(self) -> bool:
        """Tell whether points are in the body's axes; refuse points that are placed already."""
        cloud = next(iter(self._messages((self._points,))), None)
        pose = next(iter(self._messages(self._poses[:1])), None)
        if cloud is None or pose is None:
            empty = self._points if cloud is None else self._poses[0]
            raise UsageError(f"{self._path}: no message on {empty} can be read")
        frame, parent = (getattr(entry[3].header, "frame_id", "") for entry in (cloud, pose))
        if self.is_local and frame and frame == parent:
            raise UsageError(
                f"{self._path}: points on {self._points} are in the frame {frame!r} of the poses, so placed"
                " already: name the sensor's own by --points"
            )
        return bool(frame) and frame == getattr(pose[3], "child_frame_id", "")

    # ---- the library ----------------------------------------------------------------------------

    def _messages(self, topics: Sequence[str]) -> Iterator[tuple[int, int, str, Any]]:
        """Return times of recording and of the header (ns), topic and message, in the order of recording."""
        with self._opened() as reader:
            wanted = [c for c in reader.connections if c.topic in topics]
            raws = iter(reader.messages(connections=wanted))
            while True:
                try:
                    connection, at_ns, raw = next(raws)
                except StopIteration:
                    return
                except Exception as error:  # of SQLite, MCAP, LZ4, Zstandard
                    self.cut = f"it is damaged or cut off: {_line(error)}"
                    return
                try:
                    message = reader.deserialize(raw, connection.msgtype)
                    stamp_ns = _stamp_ns(message) or at_ns
                except Exception:  # whatever the generated code stumbles over
                    self.bad += 1
                    continue
                yield at_ns, stamp_ns, connection.topic, message

    @contextmanager
    def _opened(self) -> Iterator[Any]:
        try:
            from rosbags.highlevel import AnyReader
            from rosbags.typesys import Stores, get_typestore
        except ImportError:
            raise UsageError(
                f"{self._path}: a ROS bag needs the library rosbags: pip install 'slz[ros]'"
            ) from None
        try:
            reader = AnyReader([self._path], default_typestore=get_typestore(Stores.ROS2_HUMBLE))
            reader.open()
        except Exception as error:  # of YAML, SQLite, MCAP and the library
            raise UsageError(f"{self._path}: it is no ROS bag, or damaged ({_line(error)})") from None
        try:
            yield reader
        finally:
            reader.close()


def _points_topic(path: Path, types: dict[str, str], given: str | None) -> str:
    clouds = sorted(name for name, kind in types.items() if kind == CLOUD)
    if given is not None:
        return _checked(path, types, given, (CLOUD,), "--points")
    if not clouds:
        raise UsageError(f"{path}: it has no message of sensor_msgs/PointCloud2")
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


def _stamp_ns(message: Any) -> int:
    stamp = message.header.stamp
    return int(stamp.sec) * 1_000_000_000 + int(stamp.nanosec)


def _line(error: BaseException) -> str:
    return " ".join(f"{error or type(error).__name__}".split())[:120]
