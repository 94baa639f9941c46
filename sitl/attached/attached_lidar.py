"""Simulated LiDAR on a vehicle of another simulator: scene and packets are ours, the pose is theirs.

The scan between two poses is sent when the second pose has arrived, so that every point has the pose of its
own time. Its stamps are those of a clock of its own (`sensor_time`), which pauses with the simulator.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pymap3d
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from sitl.attached.attached_log import AttachedLog
from sitl.attached.pose_source import Place, Pose, PoseSource, SensorTime, streams
from sitl.scenes import Scene
from sitl.sensors import lidars
from sitl.sensors.lidar_port import Address
from sitl.vehicle.pose_track import PoseTrack
from sitl.vehicle.rigid_body import to_euler
from sitl.wire.wire import Peer, Wire

COMPONENT = mavlink.MAV_COMP_ID_PERIPHERAL
HEARTBEAT_S = 1.0
ASK_S = 1.0
LOST_S = 3.0
HOME_PATIENCE_S = 2.0
# No interpolation between poses farther apart than this, and no catching up on more scan time.
GAP_NS = 300_000_000
FLAT_M = 0.3
BEHIND_S = 0.1  # after this long without reading, the messages read are delayed ones


class AttachedLidar:
    """LiDAR that follows an autopilot's vehicle and sends its view of a scene.

    Parameters
    ----------
    scene, wire
        The scene; the wire to the autopilot.
    lidar, lidar_to
        One of `lidars.DEFAULTS`; destination of its data, None to send none.
    lidar_dual
        Whether two returns of a pulse are sent.
    origin_lla
        Origin of the scene; None places the scene's home under the vehicle, or under its autopilot's home.
    say
        Called with lines for the user.

    Attributes
    ----------
    origin_lla
        Known after the first pose.
    skipped_ns
        Time not scanned because the machine was too slow or poses were missing.
    """

    def __init__(
        self,
        scene: Scene,
        wire: Wire,
        *,
        seed: int = 1,
        lidar: str = "mid360",
        lidar_to: Address | None = None,
        point_rate_hz: int = 200_000,
        lidar_dual: bool = False,
        origin_lla: Place | None = None,
        say: Callable[[str], None] = lambda line: None,
    ) -> None:
        self.scene = scene
        self.wire = wire
        self.source = PoseSource()
        self.origin_lla = origin_lla
        self.log = AttachedLog(scene)
        rng = np.random.default_rng(seed)
        self.lidar = lidars.open_port(lidar, rng, point_rate_hz, lidar_to, lidar_dual) if lidar_to else None
        self.skipped_ns = 0
        self.poses = 0
        self._say = say
        self._track = PoseTrack()
        self._time = SensorTime()
        self._last_ns = 0
        self._peer: Peer | None = None
        self._heard_s: float | None = None
        self._lost = True
        self._first_pose_s: float | None = None
        self._next_beat_s = 0.0
        self._next_ask_s = 0.0
        self._slow_said = False
        self._read_s: float | None = None
        self._behind = False

    @property
    def ready(self) -> bool:
        """True if the scene has an origin and scans are sent."""
        return bool(self._track.stamps)

    def advance(self, now_s: float) -> bool:
        """Read arrived messages, scan up to the newest pose, and request missing streams.

        `now_s` is any clock of real seconds. Return whether anything arrived.
        """
        arrived = False
        self._behind = self._behind or (self._read_s is not None and now_s - self._read_s > BEHIND_S)
        self._read_s = now_s
        for peer, data in self.wire.poll():
            if peer is not self._peer:
                self._peer = peer
                self._next_beat_s = self._next_ask_s = now_s
                self.source.restart()
            for message in peer.parse(data):
                arrived = True
                pose = self.source.on_message(message)
                if pose is not None:
                    self._heard_s = now_s
                    self._add(pose, now_s)
        self._behind = self._behind and arrived  # until no message waits any more
        self._scan()
        self._watch(now_s)
        self._ask(now_s)
        return arrived

    # ---- poses ----------------------------------------------------------------------------------

    def _add(self, pose: Pose, now_s: float) -> None:
        self.poses += 1
        if self._first_pose_s is None:
            self._first_pose_s = now_s
        if self.origin_lla is None:
            waited = now_s - self._first_pose_s > HOME_PATIENCE_S
            self.origin_lla = self._origin(pose, waited)
            if self.origin_lla is None:
                return
        arrival_ns = round(now_s * 1e9)
        if not self._time.running:
            self._time.restart(pose.boot_ns, arrival_ns, self._last_ns + 1)
        at_ns = self._time.to_sensor_ns(pose.boot_ns, None if self._behind else arrival_ns)
        if self._track.stamps:
            step_ns = at_ns - self._track.stamps[-1]
            if step_ns < -GAP_NS:  # the autopilot rebooted; the sensor did not
                at_ns, step_ns = self._last_ns + GAP_NS, GAP_NS + 1
                self._time.restart(pose.boot_ns, arrival_ns, at_ns)
            if step_ns <= 0:
                return
            if step_ns > GAP_NS:
                self.skipped_ns += step_ns
                self._track = PoseTrack()
        east, north, up = (float(v) for v in pymap3d.geodetic2enu(*pose.lla, *self.origin_lla))
        self._track.add(at_ns, np.array([east, north, up]), pose.quat_wxyz)
        self._last_ns = at_ns
        heading_deg = math.degrees(to_euler(pose.quat_wxyz)[2]) % 360.0
        self.log.note(at_ns, (east, north, up), heading_deg, self.source)

    def _origin(self, pose: Pose, waited: bool) -> Place | None:
        """Return the scene's origin that aligns its home with the autopilot's; None while that is unknown."""
        home = self.source.home_lla
        if home is None and not waited:
            return None
        lat, lon, alt = home or pose.lla
        if not self.source.armed or home is None:  # it is on the ground, which is flat
            alt = pose.lla[2] - self.source.standing_m
        x, y, _ = self.scene.home_enu
        z = self.scene.world.height_m(x, y)
        return tuple(float(v) for v in pymap3d.enu2geodetic(-x, -y, -z, lat, lon, alt))  # type: ignore[return-value]

    def flat_share(self) -> float:
        """Return the share of the scene whose surface is within `FLAT_M` of its home's height.

        The other simulator's ground is flat: only there is the vehicle's apparent height above ground
        correct.
        """
        x, y, _ = self.scene.home_enu
        x0, y0, x1, y1 = self.scene.extent_m
        xs, ys = np.meshgrid(np.arange(x0 + 0.5, x1, 1.0), np.arange(y0 + 0.5, y1, 1.0))
        z, _ = self.scene.world.surface(xs, ys)
        return float(np.mean(np.abs(z - self.scene.world.height_m(x, y)) <= FLAT_M))

    # ---- scans ----------------------------------------------------------------------------------

    def _scan(self) -> None:
        stamps = self._track.stamps
        if len(stamps) < 2:
            return
        late_ns = stamps[-1] - stamps[0] - GAP_NS
        first = stamps[0]
        if late_ns > 0:
            self.skipped_ns += late_ns
            first += late_ns
            if not self._slow_said:
                self._slow_said = True
                self._say("too slow for this point rate: parts of the scan are left out (--point-rate)")
        if self.lidar is not None:
            self.lidar.scan(first, stamps[-1], self._track.at, self.scene.world)
        self._track.keep_last()

    # ---- the autopilot --------------------------------------------------------------------------

    def _watch(self, now_s: float) -> None:
        lost = self._heard_s is None or now_s - self._heard_s > LOST_S
        if lost and not self._lost:
            self._say(f"no pose from {self.wire.name}: waiting")
        elif self._lost and not lost:
            kind = {"ardupilot": "ArduPilot", "px4": "PX4"}.get(self.source.kind or "", "autopilot")
            self._say(f"{kind}, system {self.source.sysid}: following {self.source.source}")
            if self.source.source == "GLOBAL_POSITION_INT":
                self._say("that is its estimate: it sends no true pose")
        self._lost = lost

    def _ask(self, now_s: float) -> None:
        """Send our heartbeat, and request the streams while they are incomplete."""
        peers = self.wire.peers
        if not peers:
            return
        peer = peers[0]
        if now_s >= self._next_beat_s:
            self._next_beat_s = now_s + HEARTBEAT_S
            kind, invalid = mavlink.MAV_TYPE_ONBOARD_CONTROLLER, mavlink.MAV_AUTOPILOT_INVALID
            self._send(
                peer, mavlink.MAVLink_heartbeat_message(kind, invalid, 0, 0, mavlink.MAV_STATE_ACTIVE, 3)
            )
        complete = not self._lost and self.source.home_lla is not None and self.source.on_ground is not None
        if self.source.kind is None or self.source.sysid is None or now_s < self._next_ask_s:
            return
        self._next_ask_s = now_s + (10 * ASK_S if complete else ASK_S)
        for stream in () if complete else streams(self.source.kind):
            interval_us = 1e6 / stream.rate_hz
            self._send(
                peer,
                mavlink.MAVLink_command_long_message(
                    self.source.sysid,
                    mavlink.MAV_COMP_ID_AUTOPILOT1,
                    mavlink.MAV_CMD_SET_MESSAGE_INTERVAL,
                    0,
                    float(stream.message_id),
                    interval_us,
                    *[0.0] * 5,
                ),
            )

    def _send(self, peer: Peer, message: Any) -> None:
        codec = peer.codec
        codec.srcSystem, codec.srcComponent = self.source.sysid or 1, COMPONENT
        peer.write(bytes(message.pack(codec)))
        codec.seq = (codec.seq + 1) % 256

    def close(self) -> None:
        """Close all sockets and serial lines."""
        self.wire.close()
        if self.lidar is not None:
            self.lidar.close()
