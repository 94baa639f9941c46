"""Simulation of world, vehicle, autopilot, sensors and wires, advanced in ticks."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Self

import numpy as np

from sitl import scenes
from sitl.autopilot.airframe import Kind
from sitl.autopilot.autopilot_kinds import KINDS
from sitl.autopilot.estimator import EstimateErrors, Estimator
from sitl.autopilot.pilot import Pilot
from sitl.intruders import Intruder
from sitl.scenes import Scene
from sitl.sensors import lidars
from sitl.sensors.imu.inertial_port import InertialPort, check_unit
from sitl.sensors.lidar_port import Address
from sitl.sensors.optics import Noise, Reach
from sitl.sensors.pulse_lidar import PulseLidar
from sitl.truth.flight_log import FlightLog
from sitl.vehicle.multirotor import Vehicle
from sitl.vehicle.pose_track import PoseTrack
from sitl.vehicle.rigid_body import State
from sitl.vehicle.rotor_strike import Rotor, struck
from sitl.wire.wire import MemoryWire, Router, Wire, open_wire
from sitl.world.plant_motion import Wash

TICK_NS = 2_500_000
LOOK_NS = 10_000_000  # between two looks at what the rotors meet: 0.1 m at 10 m/s, and the way is looked at
LATE_S = 0.02  # lag behind the pace above which only every LATE_SCANS-th scan is made
LATE_SCANS = 5
IN_DUST = Reach(0.1, 0.9, 0.5, 0.9), Noise(dust=0.3)
"""Range and noise of a LiDAR in rotor dust: less than a metre, with echoes of the dust itself."""
DEFAULT_ORIGIN = (47.3977419, 8.5455938, 488.0)


class Simulation:
    """World, vehicle, autopilot, LiDAR and wires under one clock.

    `advance` first answers all arrived messages, then steps one tick. `every_tick` holds functions called
    after each tick. The LiDAR's packets are sent together every `lidar_ms`, with two returns of a pulse
    if `lidar_dual`. Those of the IMU inside the LiDAR are sent with them if `imu_to` is given.

    Attributes
    ----------
    late_s
        Returns the lag of a simulated time behind the pace, s. While it is high, most scans are skipped.
    skipped_ns
        Simulated time of the skipped scans.
    intruders
        What comes to the landing.
    rotor
        Disc that collides with solids.
    held_up
        Whether pilot, autopilot and vehicle pause while time and the sensors continue.
    """

    def __init__(
        self,
        scene: Scene,
        wires: list[Wire],
        *,
        seed: int = 1,
        origin_lla: tuple[float, float, float] = DEFAULT_ORIGIN,
        lidar: str = "mid360",
        lidar_to: Address | None = None,
        point_rate_hz: int = 200_000,
        errors: EstimateErrors | None = None,
        wind_ms: float = 3.0,
        wind_from_deg: float | None = None,
        gust_ms: float | None = None,
        autopilot_kind: str = "ardupilot",
        parameters: dict[str, float] | None = None,
        pilot_height_m: float | None = None,
        ready_after_s: float = 5.0,
        mavlink_key: bytes | None = None,
        lidar_ms: int = 10,
        lidar_dual: bool = False,
        radar_to: Address | None = None,
        imu_to: tuple[str, int] | None = None,
        airframe: Kind = Kind.MULTIROTOR,
        tick_ns: int = TICK_NS,
    ) -> None:
        if imu_to is not None:
            check_unit(lidar)
        streams = [np.random.default_rng(s) for s in np.random.SeedSequence(seed).spawn(6)]
        x, y, heading = scene.home_enu
        self.scene = scene
        scene.world.wind_ms = wind_ms
        self.origin_lla = origin_lla
        self.now_ns = 0
        home = x, y, scene.world.height_m(x, y)
        self.vehicle = Vehicle(streams[0], home, heading, wind_ms, wind_from_deg, gust_ms)
        kind = KINDS[autopilot_kind]
        self.autopilot = kind.autopilot(origin_lla, parameters, ready_after_s=ready_after_s)
        self.autopilot.airframe.kind = airframe
        self.estimator = Estimator(streams[1], errors, self.autopilot.aiding)
        self.autopilot.late_ns = lambda: round(self.late_s(self.now_ns) * 1e9)
        self.autopilot.truth_source = lambda: self.vehicle.truth
        self.router = Router(wires, streams[3], self._deliver, mavlink_key)
        self.lidar = (
            lidars.open_port(lidar, streams[2], point_rate_hz, lidar_to, lidar_dual) if lidar_to else None
        )
        self.lidar_on = True
        self.imu: InertialPort | None = None
        if imu_to is not None:
            sensor = None if self.lidar is None else self.lidar.sensor
            if isinstance(sensor, PulseLidar):
                self.imu = InertialPort(lidar, sensor, streams[5], imu_to)
        self.late_s: Callable[[int], float] = lambda now_ns: 0.0
        self.skipped_ns = 0
        self.held_up = False
        self._tick_ns = tick_ns
        self._lidar_ticks = max(1, lidar_ms * 1_000_000 // tick_ns)
        self.radar = lidars.open_port("radar", streams[4], point_rate_hz, radar_to) if radar_to else None
        self._clear = self._sight()
        self.log = FlightLog(self)
        self.intruders: list[Intruder] = []
        self.rotor = Rotor()
        self.pilot: Pilot | None = None
        if pilot_height_m is not None:
            wire = MemoryWire("pilot")
            wires.append(wire)
            self.pilot = kind.pilot(wire, pilot_height_m, mavlink_key)
        self.every_tick: list[Callable[[Simulation], None]] = [lambda s: s.log.note()]
        self._track = PoseTrack()
        self._ticks = self._scans = 0
        self._ground_m = self.vehicle.truth.pos_enu_m[2]
        self._looked, self._looked_ns = self.vehicle.truth, 0

    @classmethod
    def build(
        cls, scene: str = "stadium", *, mavlink: list[str] | None = None, seed: int = 1, **more: Any
    ) -> Self:
        """Open the wires and build a scene; see the constructor for the other arguments."""
        built = scenes.build(scene, seed)
        wires: list[Wire] = []
        try:
            for url in mavlink or []:
                wires.append(open_wire(url))  # noqa: PERF401 - open wires must be known if the next fails
            return cls(built, wires, seed=seed, **more)
        except ValueError:
            for wire in wires:
                wire.close()
            raise

    @property
    def touchdown(self) -> dict[str, Any] | None:
        """True place of the last touchdown; None in flight and after a collision."""
        return self.vehicle.contact

    def advance(self) -> int:
        """Answer arrived messages, step one tick, send due messages; return the simulated time."""
        if not self.held_up:
            self._fly()
        else:
            self.autopilot.pause_clock(self._tick_ns)
            self.now_ns += self._tick_ns
        self._ticks += 1
        truth = self.vehicle.truth
        self._track.add(self.now_ns, truth.pos_enu_m, truth.quat_wxyz, truth.vel_enu_ms)
        for intruder in self.intruders:
            intruder.on_tick(self)
        if self._ticks % self._lidar_ticks == 0:
            self._scan()
        if not self.held_up:
            self._send()
        for hook in self.every_tick:
            hook(self)
        return self.now_ns

    def _fly(self) -> None:
        """Step pilot, autopilot and vehicle by one tick."""
        self.router.read(self.now_ns)
        if self.pilot is not None:
            self.pilot.on_tick(self.now_ns)
        dt = self._tick_ns * 1e-9
        truth = self.vehicle.truth
        if not self._track.stamps:
            self._track.add(self.now_ns, truth.pos_enu_m, truth.quat_wxyz, truth.vel_enu_ms)
        estimate = self.estimator.update(dt, truth)
        demand = self.autopilot.update(dt, self.now_ns, estimate, self.vehicle.on_ground)
        self.now_ns += self._tick_ns
        if self._ticks % 4 == 3 or truth.pos_enu_m[2] - self._ground_m < 3.0:
            x, y, z = (float(v) for v in truth.pos_enu_m)
            ground = self.scene.world.height_below_m(x, y, z + self.rotor.height_m)
            self._ground_m = ground if np.isfinite(ground) else -1e6
        if self.now_ns - self._looked_ns >= LOOK_NS:
            self._look(truth)
        if self.autopilot.armed or not self.vehicle.on_ground:
            self.vehicle.update(dt, self.now_ns, demand, self._ground_m)
            if self.vehicle.collision is not None:
                self.autopilot.crash()

    def _look(self, truth: State) -> None:
        """See whether the rotors met something on the way here from where it was last looked."""
        before, self._looked, self._looked_ns = self._looked, truth, self.now_ns
        if self.autopilot.armed and struck(self.scene.world, self.rotor, before, truth):
            self.vehicle.strike(self.now_ns)

    def _send(self) -> None:
        for peer in self.router.peers():
            self.autopilot.add_link(self.router.number(peer))
        for link, message in self.autopilot.take_outgoing(self.now_ns):
            self.router.send(link, message)

    def run(self, seconds: float) -> Self:
        """Advance by a number of simulated seconds."""
        end = self.now_ns + round(seconds * 1e9)
        while self.now_ns < end:
            self.advance()
        return self

    def fill_air(self, air: str) -> None:
        """Let the LiDAR see the particles of some air, see `lidars.fill_air`."""
        if self.lidar is not None:
            lidars.fill_air(self.lidar, air)
            self._clear = self._sight()

    def _deliver(self, message: Any, link: int) -> None:
        self.autopilot.receive(message, link, self.now_ns)

    def _scan(self) -> None:
        if self.scene.dust_below_m > 0:
            self._raise_dust()
        if self.scene.wash:
            self._blow()
        span = self._track.stamps[0], self.now_ns
        self._scans += 1
        if self._scans % LATE_SCANS and self.late_s(self.now_ns) > LATE_S:
            self.skipped_ns += span[1] - span[0]
            self._track.keep_last()
            return
        for port in (self.lidar if self.lidar_on else None, self.radar):
            if port is not None:
                port.scan(*span, self._track.at, self.scene.world)
        if self.imu is not None and self.lidar_on:
            self.imu.scan(*span, self._track)
        self._track.keep_last()

    def _sight(self) -> tuple[Reach, Noise] | None:
        """Return range limits and noise of a pulsed LiDAR in clear air; None for any other sensor."""
        sensor = None if self.lidar is None else self.lidar.sensor
        return (sensor.reach, sensor.noise) if isinstance(sensor, PulseLidar) else None

    def _raise_dust(self) -> None:
        """Blind a LiDAR while the rotors turn near the ground: its pulses end in the dust."""
        sensor = None if self.lidar is None else self.lidar.sensor
        if self._clear is None or not isinstance(sensor, PulseLidar):
            return
        over_m = self.vehicle.truth.pos_enu_m[2] - self._ground_m
        dusty = over_m < self.scene.dust_below_m and not self.vehicle.on_ground
        sensor.reach, sensor.noise = IN_DUST if dusty else self._clear

    def _blow(self) -> None:
        """Press the plants below the rotors while they turn near the ground."""
        x, y, z = (float(v) for v in self.vehicle.truth.pos_enu_m)
        over_m = z + self.rotor.height_m - self._ground_m
        turning = self.autopilot.armed or not self.vehicle.on_ground
        self.scene.world.wash = Wash.below(self.rotor.radius_m, x, y, over_m) if turning else None

    def close(self) -> None:
        """Close all sockets and serial lines."""
        self.router.close()
        for port in (self.lidar, self.radar, self.imu):
            if port is not None:
                port.close()
