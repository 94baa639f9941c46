"""Execution of the executive's commands: texts, modes, setpoints, selection and landing target."""

from __future__ import annotations

import logging

import numpy as np
from numpy.typing import NDArray

from companion.flight.commander_watch import CommanderWatch
from companion.flight.fusion.pose_history import PoseHistory
from companion.flight.geometry.axes import enu_from_level
from companion.flight.landing.look_ahead import LEVEL_M, half_width_m, limit_velocity
from companion.flight.landing.situation import STOPPED, Situation, VehicleCommands
from companion.flight.link.link import Link
from companion.flight.mapping.pipeline_worker import PipelineWorker
from companion.flight.mapping.vehicle_surroundings import Surroundings
from companion.flight.mode_requests import ModeRequests
from companion.flight.outputs.setpoint import offboard_signal, velocity_setpoint
from params import Parameters

log = logging.getLogger(__name__)


class CommandExecution:
    """Sends what the executive commands.

    Parameters
    ----------
    parameters
        Nearest range of the LiDAR: what is nearer is not seen. Sizes of the vehicle.

    Attributes
    ----------
    blocked, blocked_above
        Something is in the way that the last velocity led, ahead or above.
    sent_enu_ms
        Velocity of the setpoint that was sent last step, None without one.
    target_enu_m
        Landing point (3,) for LANDING_TARGET, None for none.
    """

    def __init__(
        self,
        link: Link,
        history: PoseHistory,
        worker: PipelineWorker,
        surroundings: Surroundings,
        modes: ModeRequests,
        commanders: CommanderWatch,
        parameters: Parameters,
    ) -> None:
        self._commanders = commanders
        self._link, self._history, self._worker = link, history, worker
        self._surroundings, self._modes = surroundings, modes
        self._lidar_min_m, self._aside_m = parameters.lidar_min_m, half_width_m(parameters)
        self._last_open_ns = 0
        self.sent_enu_ms: NDArray[np.float64] | None = None
        self.target_enu_m: NDArray[np.float64] | None = None
        self.blocked = self.blocked_above = False

    def execute(self, commands: VehicleCommands, situation: Situation) -> None:
        """Carry out the commands of this moment; a vehicle that must not be commanded gets texts alone.

        Not even the signal that keeps the guided mode open, which a fixed wing enters and flies on.
        """
        self._link.note_lasting(commands.lasting)
        for severity, text in commands.texts:
            log.info(text)
            self._link.statustext(text, severity.value)
        if commands.select_enu_m is not None:
            self._worker.select(commands.select_enu_m)
        self.sent_enu_ms = None
        if self._link.no_command_reason:
            self._modes.cancel()
            self.target_enu_m = None
            return
        if commands.mode is not None:
            self._modes.request(commands.mode)
        else:
            self._modes.review(situation)
        vehicle = self._link.vehicle
        if commands.velocity_enu_ms is not None and (vehicle.guided or commands.mode == "guided"):
            velocity = self.sent_enu_ms = self._limit_velocity(commands.velocity_enu_ms, situation)
            self._link.send(velocity_setpoint(vehicle, velocity, commands.yaw_rad))
            self._commanders.on_setpoint(velocity, situation.now_ns)
        elif self._must_keep_guided_open(situation) and (signal := offboard_signal(vehicle)) is not None:
            self._link.send(signal)
            self._commanders.on_setpoint(STOPPED, situation.now_ns, idle=True)
        self.target_enu_m = commands.target_enu_m

    def stop_vehicle(self) -> None:
        """Send the last setpoint: ArduPilot flies on with the one before for three seconds."""
        if self._link.no_command_reason:
            return
        self._link.send(velocity_setpoint(self._link.vehicle, np.zeros(3), None))

    def _must_keep_guided_open(self, situation: Situation) -> bool:
        """Return whether a signal is due, without which the autopilot does not enter or keep the guided mode.

        In that mode it would brake a vehicle that follows another's setpoints.
        """
        interval_ns, flying = self._link.vehicle.autopilot.open_signal_ns, situation.on_ground is False
        if self._commanders.is_foreign or interval_ns is None or not (situation.armed and flying):
            return False
        due = situation.now_ns - self._last_open_ns >= interval_ns
        if due:
            self._last_open_ns = situation.now_ns
        return due

    def _limit_velocity(
        self, velocity_enu_ms: NDArray[np.float64], situation: Situation
    ) -> NDArray[np.float64]:
        """Return the velocity that stops before what was seen ahead."""
        self.blocked = self.blocked_above = False
        pose = self._history.latest(situation.now_ns)
        if pose is None or not velocity_enu_ms.any():
            return velocity_enu_ms
        axes = enu_from_level(pose)
        around = self._surroundings.level_frd_m(pose, situation.now_ns, LEVEL_M)
        limited = limit_velocity(velocity_enu_ms @ axes, around, self._lidar_min_m, self._aside_m)
        self.blocked, self.blocked_above = limited.blocked, limited.blocked_above
        return np.asarray(axes @ limited.velocity_frd_ms)
