"""Examination of autopilot, LiDAR and computer: listen for a while, then judge."""

from __future__ import annotations

import asyncio
import contextlib
import logging
import math
from dataclasses import dataclass, field
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from companion.flight.doctor.finding import Finding
from companion.flight.doctor.imu_check import ImuObservation
from companion.flight.doctor.lidar_check import lidar_findings
from companion.flight.doctor.link_check import link_findings
from companion.flight.doctor.machine_check import machine_findings
from companion.flight.doctor.parameter_check import Version, parameter_findings, version_finding
from companion.flight.geometry.sensor_mount import Mount
from companion.flight.link.link import Link
from companion.flight.link.message_rates import expected
from companion.flight.link.parameter_reader import ParameterReader
from companion.flight.link.vehicle_identity import LISTEN_NS, NAME_IT, VehicleIdentity, several
from companion.flight.link.wire.signing import Signing
from companion.flight.sensors.lidar_url import Lidar, open_lidar
from companion.flight.services.fence_reader import AutopilotFence, FenceReader
from companion.runtime.clock import now_ns
from params import Parameters, airworthy, grounded

log = logging.getLogger(__name__)

STEP_S = 0.02
TIMER_S = 0.01
SETTLE_S = 2.0
IDENTIFY_S = LISTEN_NS * 1e-9 + 1.5  # the first heartbeat arrives within a second
PARAMETERS_S, FENCE_S = 20.0, 15.0
VERSION_TRIES, VERSION_S = 3, 0.3


REMEDY = (
    "look at the fence in the ground station and write it again, or disable it: as long as slz does not know "
    "it, --land auto does not begin, and an order may lead against it"
)


ONE = "one aircraft, or --system"


def neighbour_findings(identity: VehicleIdentity) -> list[Finding]:
    """Judge the autopilots heard; empty without any, or if the vehicle is alone or was named."""
    heard = identity.candidates | identity.passed_over
    if identity.ambiguous:
        found = several(identity.candidates.values()).partition(":")[0]
        return [Finding("autopilot", "fail", found, ONE, NAME_IT)]
    if identity.system is None and heard:
        found = " and ".join(map(str, heard.values()))
        return [Finding("autopilot", "fail", f"only {found}", ONE, f"connect to the vehicle, or {NAME_IT}")]
    others = [str(c) for system, c in sorted(identity.candidates.items()) if system != identity.system]
    if not others or identity.named is not None:
        return []
    found = f"{' and '.join(others)} beside system {identity.system}"
    remedy = (
        f"run with --system {identity.system}: at a start that hears both at once, neither is the vehicle"
    )
    return [Finding("other vehicles", "fail", found, ONE, remedy)]


def grounded_findings(parameters: Parameters) -> list[Finding]:
    """Return a fault for each value that `slz run` refuses."""
    return [
        Finding(
            one.row.mavlink,
            "fail",
            f"{one.value} {one.reason}",
            one.allowed,
            f"set {one.row.name} to {one.allowed}: slz run refuses {one.value}",
        )
        for one in grounded(parameters)
    ]


def assist_finding(parameters: Parameters) -> Finding:
    """Return the setting of `SLZ_ASSIST` with its meaning; each is right."""
    meaning = {
        "off": "off: landings of the autopilot's own end where it puts them",
        "offer": "offer: landings of the autopilot's own get a safe target",
        "act": "act: as offer, and a landing that takes no target is taken over",
    }
    return Finding("assist", "ok", meaning[parameters.assist])


def fence_finding(fence: AutopilotFence | None) -> Finding:
    """Judge the fence as read; None if it could not be read, or its items make none."""
    if fence is None:
        return Finding("fence", "fail", "could not be read", "no fence, or one that is read", REMEDY)
    parts = []
    if math.isfinite(fence.radius_m):
        parts.append(f"circle of {fence.radius_m:g} m")
    if math.isfinite(fence.highest_m):
        parts.append(f"flown up to {fence.highest_m:g} m")
    if math.isfinite(fence.lowest_m):
        parts.append(f"down to {fence.lowest_m:g} m")
    if fence.areas:
        parts.append(f"{len(fence.areas)} area" + "s" * (len(fence.areas) > 1))
    if not parts:
        return Finding("fence", "ok", "none")
    return Finding("fence", "ok", f"{', '.join(parts)}; {fence.margin_m:g} m kept from it")


@dataclass(slots=True)
class Examination:
    """One run of the doctor.

    Parameters
    ----------
    mavlink_url, lidar_url
        URLs as in `slz run`.
    seconds
        Listening time.
    signing
        MAVLink signing of the link, None for an unsigned one.
    system
        MAVLink system of the vehicle; None: the only aircraft heard.

    Raises
    ------
    UsageError
        From `run`: a URL is wrong or its port is in use.
    """

    mavlink_url: str
    lidar_url: str
    parameters: Parameters
    seconds: float = 10.0
    signing: Signing | None = None
    system: int | None = None
    late_ms: list[float] = field(default_factory=list)

    async def run(self) -> list[Finding]:
        """Return all findings; close everything that was opened."""
        found = grounded_findings(self.parameters)
        self.parameters = airworthy(self.parameters)  # examine for what can fly
        identity = VehicleIdentity(self.system, LISTEN_NS)
        link = Link(self.mavlink_url, self.parameters, self.signing, identity, alone=False)
        lidar = open_lidar(self.lidar_url, self.parameters, lambda returns: None, link)
        inertial = ImuObservation(Mount(self.parameters))
        lidar.on_imu(inertial.add_samples)
        link.inbox.on_attitude(inertial.add_attitude)
        begun_ns = now_ns()
        log.info("listening for %g s", self.seconds)
        try:
            async with asyncio.TaskGroup() as group:
                parts = [
                    group.create_task(link.run(), name="link"),
                    group.create_task(lidar.run(), name="lidar"),
                    group.create_task(self._watch_timer(), name="timer"),
                ]
                await self._identify(link)
                await asyncio.sleep(self.seconds)
                findings = self._lidar(lidar, (now_ns() - begun_ns) * 1e-9)
                findings += inertial.findings(lidar.statistics())
                findings = [*await self._autopilot(link), *findings, *await self._parameters(link)]
                findings += await self._fence(link)
                await link.close()
                for part in parts[1:]:
                    part.cancel()
        except BaseExceptionGroup as errors:
            raise errors.exceptions[0] from None
        log.info("measuring this computer; the first time this compiles for some minutes")
        found.append(assist_finding(self.parameters))
        # Last, because it loads the CPU.
        return [*found, *findings, *machine_findings(self.parameters, self.late_ms)]

    async def _autopilot(self, link: Link) -> list[Finding]:
        version = None if link.key_mismatch else await self._version(link)
        found = self._link(link)
        return found if link.key_mismatch else [*found, version_finding(link.vehicle.autopilot, version)]

    def _link(self, link: Link) -> list[Finding]:
        p = self.parameters
        streams = expected(link.vehicle.autopilot, p.pose_rate_hz, odometry=p.odometry == "autopilot")
        others = neighbour_findings(link.identity)
        if others and link.vehicle.sysid is None:
            return others
        vehicle, statistics = link.vehicle, link.statistics()
        return [*others, *link_findings(self.mavlink_url, vehicle, statistics, streams, link.key_mismatch)]

    def _lidar(self, lidar: Lidar, seconds: float) -> list[Finding]:
        statistics = lidar.statistics()
        episodes = [] if lidar.diagnosis is None else lidar.diagnosis.episodes
        return lidar_findings(self.lidar_url, seconds, int(statistics["packets"] or 0), statistics, episodes)

    async def _version(self, link: Link) -> Version | None:
        versions: list[Version] = []
        forget = link.subscribe(
            "AUTOPILOT_VERSION", lambda message, _: versions.append(Version.unpack(message.flight_sw_version))
        )
        wanted = float(mavlink.MAVLINK_MSG_ID_AUTOPILOT_VERSION)
        try:
            for _ in range(VERSION_TRIES):  # the command may be acknowledged and the message lost
                await link.command(mavlink.MAV_CMD_REQUEST_MESSAGE, wanted, timeout_s=0.7, tries=2)
                await asyncio.sleep(VERSION_S)
                if versions:
                    break
        finally:
            forget()
        return versions[-1] if versions else None

    async def _parameters(self, link: Link) -> list[Finding]:
        vehicle = link.vehicle
        rows = vehicle.autopilot.required(self.parameters.odometry == "autopilot")
        if vehicle.sysid is None:
            return [Finding("parameters", "skipped", "no autopilot to ask")]
        if link.key_mismatch is not None:
            return [Finding("parameters", "skipped", "the autopilot does not hear us: see signing")]
        reader = ParameterReader(rows, vehicle.autopilot)
        names = ("PARAM_VALUE", "PARAM_ERROR")
        forget = [link.subscribe(name, lambda message, _: reader.on_message(message)) for name in names]
        try:
            async with asyncio.timeout(PARAMETERS_S):
                while not reader.done:
                    for request in reader.due(vehicle.sysid, now_ns()):
                        link.send(request)
                    await asyncio.sleep(STEP_S)
        except TimeoutError:
            pass  # a parameter that did not arrive is a finding
        finally:
            for unsubscribe in forget:
                unsubscribe()
        return parameter_findings(rows, reader.values, reader.absent)

    async def _fence(self, link: Link) -> list[Finding]:
        """Read the fence once."""
        vehicle, reader = link.vehicle, FenceReader()
        if vehicle.sysid is None or vehicle.autopilot.fence is None or link.key_mismatch is not None:
            return []
        system, us = vehicle.sysid, (link.system_id, link.component_id)

        def answer(message: Any, at_ns: int) -> None:
            for reply in reader.on_mission(message, at_ns, system, us):
                link.send(reply)

        def read(message: Any, _at_ns: int) -> None:
            reader.on_parameter(message)

        missions, values = (
            ("MISSION_COUNT", "MISSION_ITEM_INT", "MISSION_ACK"),
            ("PARAM_VALUE", "PARAM_ERROR"),
        )
        forget = [link.subscribe(name, answer) for name in missions]
        forget += [link.subscribe(name, read) for name in values]
        try:
            async with asyncio.timeout(FENCE_S):
                while not reader.is_read:
                    for request in reader.poll(now_ns(), link.vehicle, link.connected, us, quiet=True):
                        link.send(request)
                    await asyncio.sleep(STEP_S)
        except TimeoutError:
            pass  # then it is unknown
        finally:
            for unsubscribe in forget:
                unsubscribe()
        return [fence_finding(reader.fence(link.vehicle))]

    async def _identify(self, link: Link) -> None:
        """Wait until the vehicle is connected, at most `IDENTIFY_S`, which includes listening for others."""
        connected = asyncio.Event()
        forget = link.on_connection.subscribe(lambda _: connected.set())
        with contextlib.suppress(TimeoutError):
            await asyncio.wait_for(connected.wait(), IDENTIFY_S)
        forget()

    async def _watch_timer(self) -> None:
        await asyncio.sleep(min(SETTLE_S, self.seconds / 2))
        while True:
            begun = now_ns()
            await asyncio.sleep(TIMER_S)
            self.late_ms.append((now_ns() - begun) * 1e-6 - 1000 * TIMER_S)
