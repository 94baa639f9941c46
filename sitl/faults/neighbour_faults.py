"""Other systems: beside us on the link, a second vehicle, station or gimbal; elsewhere, other commanders."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import TYPE_CHECKING, Any

import numpy as np
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from sitl.autopilot.modes import Mode
from sitl.faults.fault import Fault
from sitl.wire.wire import MemoryWire

if TYPE_CHECKING:
    from sitl.simulation import Simulation

OURS, VEHICLE, STATION = 1, 2, 254
COMPANION = 191
FAST_NS, SLOW_NS = 100_000_000, 1_000_000_000


class _Neighbour(Fault, ABC):
    """System whose messages all receivers on the link get, and the autopilot through its own routing."""

    def __init__(self, system: int, component: int) -> None:
        self._codec: Any = mavlink.MAVLink(None, srcSystem=system, srcComponent=component)
        self._wire = MemoryWire(f"system {system}")
        self._peers: list[Any] = []
        self._next_ns = 0
        self._every_ns = SLOW_NS
        self._is_heard = True  # by the companion, too

    def start(self, simulation: Simulation) -> None:
        self._peers = simulation.router.peers() if self._is_heard else []
        simulation.router.wires.append(self._wire)
        self._next_ns = simulation.now_ns

    def on_tick(self, simulation: Simulation) -> None:
        self._wire.received.clear()
        if simulation.now_ns < self._next_ns:
            return
        self._next_ns += self._every_ns
        for message in self.words(simulation.now_ns):
            data = bytes(message.pack(self._codec))
            self._codec.seq = (self._codec.seq + 1) % 256
            self._wire.send(data)
            for peer in self._peers:  # a shared link: also messages not addressed to them
                peer.write(data)

    def stop(self, simulation: Simulation) -> None:
        simulation.router.wires.remove(self._wire)

    @abstractmethod
    def words(self, now_ns: int) -> list[Any]:
        """Return the messages to send now."""


class SecondVehicle(_Neighbour):
    """Another autopilot, system 2, disarmed on the ground some way off, in a mode chosen by its own pilot."""

    def __init__(self, rng: np.random.Generator) -> None:
        super().__init__(VEHICLE, 1)
        self._every_ns = FAST_NS
        self._lat_e7, self._lon_e7 = (int(v) for v in rng.integers(100_000_000, 400_000_000, 2))
        self._boot_ms = int(rng.integers(1_000, 10_000_000))

    def words(self, now_ns: int) -> list[Any]:
        self._boot_ms += FAST_NS // 1_000_000
        return [
            mavlink.MAVLink_heartbeat_message(2, 3, 1, int(Mode.LOITER), 3, 3),
            mavlink.MAVLink_attitude_quaternion_message(self._boot_ms, 0.0, 1.0, 0.0, 0.0, 0, 0, 0),
            mavlink.MAVLink_global_position_int_message(
                self._boot_ms, self._lat_e7, self._lon_e7, 90_000, 0, 500, 500, 0, 0
            ),
            mavlink.MAVLink_extended_sys_state_message(0, mavlink.MAV_LANDED_STATE_ON_GROUND),
            mavlink.MAVLink_sys_status_message(0, 0, 0, 0, 10_000, 0, 1, 0, 0, 0, 0, 0, 0),
            mavlink.MAVLink_timesync_message(self._boot_ms * 1_000_000, now_ns),
        ]


class SecondStation(_Neighbour):
    """Another ground station, system 254: commands for another vehicle, and answers addressed to itself.

    Its land and abort commands are addressed to system 2; the acknowledgements of refused modes to itself.
    """

    def __init__(self, rng: np.random.Generator) -> None:
        super().__init__(STATION, mavlink.MAV_COMP_ID_MISSIONPLANNER)
        self._turn = int(rng.integers(2))

    def words(self, now_ns: int) -> list[Any]:
        self._turn += 1
        order = float(self._turn % 2)  # land at the best zone, or abort
        refused = mavlink.MAV_RESULT_FAILED
        return [
            mavlink.MAVLink_heartbeat_message(6, 8, 0, 0, 4, 3),
            mavlink.MAVLink_command_long_message(
                VEHICLE, COMPANION, mavlink.MAV_CMD_USER_1, 0, order, 0, 0, 0, 0, 0, 0
            ),
            mavlink.MAVLink_command_long_message(
                1,
                1,
                mavlink.MAV_CMD_REQUEST_MESSAGE,
                0,
                mavlink.MAVLINK_MSG_ID_HOME_POSITION,
                0,
                0,
                0,
                0,
                0,
                0,
            ),
            mavlink.MAVLink_command_ack_message(
                mavlink.MAV_CMD_DO_SET_MODE, refused, 0, 0, STATION, mavlink.MAV_COMP_ID_MISSIONPLANNER
            ),
            mavlink.MAVLink_param_request_read_message(1, 1, b"RTL_ALT", -1),
        ]


class Gimbal(_Neighbour):
    """Gimbal of the vehicle's own system, component 154, with an attitude and a state of its own.

    It looks ahead and down, rotates continuously, reports a constant false position, and refuses commands
    that nobody sent.
    """

    def __init__(self, rng: np.random.Generator) -> None:
        super().__init__(OURS, mavlink.MAV_COMP_ID_GIMBAL)
        self._every_ns = FAST_NS
        self._boot_ms = int(rng.integers(1_000, 10_000_000))
        self._lat_e7, self._lon_e7 = (int(v) for v in rng.integers(100_000_000, 400_000_000, 2))
        self._pitch_rad = float(rng.uniform(-1.2, -0.4))
        self._yaw_rad = 0.0

    def words(self, now_ns: int) -> list[Any]:
        self._boot_ms += FAST_NS // 1_000_000
        self._yaw_rad += 0.1
        cp, sp = np.cos(self._pitch_rad / 2), np.sin(self._pitch_rad / 2)
        cy, sy = np.cos(self._yaw_rad / 2), np.sin(self._yaw_rad / 2)
        unasked = mavlink.MAV_RESULT_FAILED
        return [
            mavlink.MAVLink_heartbeat_message(
                mavlink.MAV_TYPE_GIMBAL, mavlink.MAV_AUTOPILOT_INVALID, 0, 0, 4, 3
            ),
            mavlink.MAVLink_attitude_quaternion_message(
                self._boot_ms, cp * cy, -sp * sy, sp * cy, cp * sy, 0, 0, 1.0
            ),
            mavlink.MAVLink_attitude_message(self._boot_ms, 0, self._pitch_rad, self._yaw_rad, 0, 0, 1.0),
            mavlink.MAVLink_global_position_int_message(
                self._boot_ms, self._lat_e7, self._lon_e7, 90_000, 0, 500, 500, 0, 0
            ),
            mavlink.MAVLink_extended_sys_state_message(0, mavlink.MAV_LANDED_STATE_ON_GROUND),
            mavlink.MAVLink_sys_status_message(0, 0, 0, 0, 10_000, 0, 1, 0, 0, 0, 0, 0, 0),
            mavlink.MAVLink_timesync_message(self._boot_ms * 1_000_000, now_ns),
            mavlink.MAVLink_command_ack_message(mavlink.MAV_CMD_DO_SET_MODE, unasked, 0, 0, OURS, COMPANION),
        ]


class FlyHere(_Neighbour):
    """Ground station on a link of its own, whose operator has the vehicle fly to a place (DO_REPOSITION).

    He taps again and again, a place 15 to 30 m away and 2 m higher. As QGroundControl's, the command changes
    the mode to GUIDED.
    """

    def __init__(self, rng: np.random.Generator) -> None:
        super().__init__(255, mavlink.MAV_COMP_ID_MISSIONPLANNER)
        self._is_heard = False
        bearing, away_m = rng.uniform(0.0, 2 * np.pi), rng.uniform(15.0, 30.0)
        self._offset_m = np.array([away_m * np.sin(bearing), away_m * np.cos(bearing), 2.0])
        self._place: tuple[float, float, float] | None = None

    def start(self, simulation: Simulation) -> None:
        super().start(simulation)
        estimate = simulation.autopilot.estimate
        if estimate is not None:
            self._place = simulation.autopilot.lla(estimate.pos_enu_m + self._offset_m)

    def words(self, now_ns: int) -> list[Any]:
        if self._place is None:
            return []
        lat, lon, alt = self._place
        return [
            mavlink.MAVLink_command_int_message(
                OURS, 1, mavlink.MAV_FRAME_GLOBAL, mavlink.MAV_CMD_DO_REPOSITION, 0, 0,
                -1.0, 1.0, 0.0, float("nan"), round(lat * 1e7), round(lon * 1e7), alt,
            )
        ]  # fmt: skip


class SecondCompanion(_Neighbour):
    """Another companion on a link of its own that sends velocities to the vehicle in GUIDED, ten a second."""

    def __init__(self, rng: np.random.Generator) -> None:
        super().__init__(OURS, 195)
        self._is_heard, self._every_ns = False, FAST_NS
        bearing = float(rng.uniform(0.0, 2 * np.pi))
        self._velocity_ned_ms = (3.0 * float(np.cos(bearing)), 3.0 * float(np.sin(bearing)), 0.0)

    def words(self, now_ns: int) -> list[Any]:
        mask, nowhere = 0b110111000111, (0.0, 0.0, 0.0)
        return [
            mavlink.MAVLink_set_position_target_local_ned_message(
                now_ns // 1_000_000, OURS, 1, mavlink.MAV_FRAME_LOCAL_NED, mask,
                *nowhere, *self._velocity_ned_ms, *nowhere, 0.0, 0.0,
            )
        ]  # fmt: skip
