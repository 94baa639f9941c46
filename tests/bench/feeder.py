"""Real-time vehicle of negligible cost: a LiDAR with precomputed packets, and poses from a formula.

The whole simulator needs a core of its own at 200,000 points/s, so beside it nothing could be timed on two
cores. This one circles over a scene with a period of `PERIOD_S`, so that its packets can be repeated.

`python -m tests.bench.feeder MAVLINK_PORT LIDAR_PORT POINTS_PER_S` runs until it is ended, or until its
parent closes stdin, and prints on one line when every LANDING_TARGET arrived (ns, monotonic clock).
"""

from __future__ import annotations

import json
import math
import select
import socket
import struct
import sys
import time
import zlib
from typing import Any

import numpy as np
import pymap3d
from numpy.typing import NDArray
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from sitl import scenes
from sitl.sensors.livox_packets import HEADER, HEADER_BYTES
from sitl.sensors.mid360 import Mid360
from sitl.sensors.sensor_clock import Clock

F64 = NDArray[np.float64]

PERIOD_S = 4.0
SWAY_M = 2.0
HEIGHT_M = 12.0
ORIGIN = (47.3977419, 8.5455938, 488.0)
STEP_NS = 2_000_000
POSE_NS = 20_000_000
BOOT_NS = 3_000_000_000
STAMP = struct.Struct("<Q")


def position_enu_m(time_s: float | F64, up_m: float) -> tuple[Any, Any, Any]:
    """Return where the vehicle is: a circle about the scene's origin."""
    turn = 2 * math.pi / PERIOD_S * np.asarray(time_s)
    return SWAY_M * np.cos(turn), SWAY_M * np.sin(turn), up_m + 0 * turn


def velocity_enu_ms(time_s: float) -> tuple[float, float, float]:
    turn = 2 * math.pi / PERIOD_S
    return -SWAY_M * turn * math.sin(turn * time_s), SWAY_M * turn * math.cos(turn * time_s), 0.0


class Feeder:
    """Sends poses, answers and packets as their time comes."""

    def __init__(self, mavlink_port: int, lidar_port: int, points_per_s: int) -> None:
        scene = scenes.build("stadium", 1)
        self._up_m = float(scene.world.height_m(0.0, 0.0)) + HEIGHT_M
        self._packets = self._fired(scene.world, points_per_s)
        self._wire = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._wire.setblocking(False)
        self._to, self._lidar_to = ("127.0.0.1", mavlink_port), ("127.0.0.1", lidar_port)
        self._codec: Any = mavlink.MAVLink(None, srcSystem=1, srcComponent=1)
        self._codec.robust_parsing = True
        self.arrivals_ns: list[int] = []

    def _fired(self, world: Any, points_per_s: int) -> list[tuple[int, bytes]]:
        """Return the packets of one period: when each is due (ns), and its bytes."""

        def pose_at(stamps_ns: NDArray[np.int64]) -> tuple[F64, F64]:
            where = np.column_stack(position_enu_m(stamps_ns * 1e-9, self._up_m))
            return where, np.tile([1.0, 0.0, 0.0, 0.0], (len(where), 1))

        lidar = Mid360(
            np.random.default_rng(1), point_rate_hz=points_per_s, clock=Clock(offset_ns=0, drift_ppb=0)
        )
        packets = []
        for t in range(0, round(PERIOD_S * 1e9), 50_000_000):
            for packet in lidar.scan(t, t + 50_000_000, pose_at, world):
                stamp = STAMP.unpack_from(packet, HEADER.size)[0]
                interval = struct.unpack_from("<H", packet, 3)[0] * 100
                packets.append((stamp + interval, packet))
        return packets

    def _restamped(self, packet: bytes, count: int, loop: int) -> bytes:
        stamp = STAMP.unpack_from(packet, HEADER.size)[0] + loop * round(PERIOD_S * 1e9)
        checked = STAMP.pack(stamp) + packet[HEADER_BYTES:]
        return packet[:7] + struct.pack("<H", count & 0xFFFF) + packet[9:24] + struct.pack(
            "<I", zlib.crc32(checked)
        ) + checked  # fmt: skip

    def run(self) -> None:
        start, next_pose, next_beat, sent = time.monotonic_ns(), 0, 0, 0
        while not select.select([sys.stdin], [], [], 0)[0]:
            now = time.monotonic_ns() - start
            self._receive(now)
            if now >= next_beat:
                next_beat += 1_000_000_000
                self._send(mavlink.MAVLink_heartbeat_message(2, 3, 128 | 81, 4, 4, 3))
                self._send(mavlink.MAVLink_extended_sys_state_message(0, 2))
            if now >= next_pose:
                next_pose = max(next_pose + POSE_NS, now - POSE_NS)
                self._send_pose(now)
            while True:
                loop, index = divmod(sent, len(self._packets))
                due, packet = self._packets[index]
                if due + loop * round(PERIOD_S * 1e9) > now:
                    break
                self._wire.sendto(self._restamped(packet, sent, loop), self._lidar_to)
                sent += 1
            time.sleep(max(0, STEP_NS - (time.monotonic_ns() - start - now)) * 1e-9)

    def _send_pose(self, now: int) -> None:
        boot_ms = (BOOT_NS + now) // 1_000_000
        t = (boot_ms * 1_000_000 - BOOT_NS) * 1e-9
        east, north, up = (float(v) for v in position_enu_m(t, self._up_m))
        lat, lon, alt = pymap3d.enu2geodetic(east, north, up, *ORIGIN)
        v = velocity_enu_ms(t)
        self._send(mavlink.MAVLink_attitude_quaternion_message(boot_ms, 1.0, 0, 0, 0, 0, 0, 0))
        self._send(
            mavlink.MAVLink_global_position_int_message(
                boot_ms, round(lat * 1e7), round(lon * 1e7), round(alt * 1e3), round(HEIGHT_M * 1e3),
                round(v[1] * 100), round(v[0] * 100), 0, 0,
            )
        )  # fmt: skip

    def _receive(self, now: int) -> None:
        while True:
            try:
                data = self._wire.recv(65536)
            except OSError:
                return
            at = time.monotonic_ns()
            for message in self._codec.parse_buffer(data) or []:
                kind = message.get_type()
                if kind == "LANDING_TARGET":
                    self.arrivals_ns.append(at)
                elif kind == "TIMESYNC" and message.tc1 == 0:
                    answered = BOOT_NS + now + (time.monotonic_ns() - at)
                    self._send(mavlink.MAVLink_timesync_message(answered, message.ts1))
                elif kind == "COMMAND_LONG":
                    self._send(mavlink.MAVLink_command_ack_message(message.command, 0))

    def _send(self, message: Any) -> None:
        self._wire.sendto(message.pack(self._codec), self._to)
        self._codec.seq = (self._codec.seq + 1) % 256


if __name__ == "__main__":
    feeder = Feeder(int(sys.argv[1]), int(sys.argv[2]), int(sys.argv[3]))
    print("ready", flush=True)
    feeder.run()
    print(json.dumps(feeder.arrivals_ns), flush=True)
