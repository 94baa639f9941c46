"""Wires everything: link, LiDAR, fusion, pipeline, executive, outputs."""

from __future__ import annotations

import asyncio
import gc
import logging
from collections.abc import Coroutine
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from companion.flight.doctor.autopilot_fitness import Fitness
from companion.flight.flight_summary import flight_summary
from companion.flight.fusion.assembler import ScanAssembler
from companion.flight.fusion.pose_history import PoseHistory
from companion.flight.fusion.second_sensor import open_beside
from companion.flight.geometry.axes import enu_from_level
from companion.flight.landing.executive import Executive
from companion.flight.landing.landing_memory import Landing, LandingMemory
from companion.flight.landing.landing_point_news import PointWatch
from companion.flight.landing.look_ahead import LEVEL_M, held_back
from companion.flight.landing.operator_commands import OperatorCommands
from companion.flight.landing.operator_order import Operator
from companion.flight.landing.restart import Restart
from companion.flight.landing.situation import FLYING, Phase, Severity, Situation
from companion.flight.link.link import Link
from companion.flight.link.wire.signing import Signing
from companion.flight.map_frame import begin_frame_if_far
from companion.flight.mapping.pipeline_worker import PipelineWorker
from companion.flight.mapping.recent_obstacles import ObstacleMemory
from companion.flight.mapping.survey_prior import SurveyPrior
from companion.flight.outputs.landing_status import Status
from companion.flight.outputs.schedule import Streams
from companion.flight.outputs.setpoint import offboard_signal, velocity_setpoint
from companion.flight.recorder.recordings import Recordings
from companion.flight.sensors.driver import Lidar, open_lidar
from companion.flight.services.order_parameters import OrderParameters
from companion.flight.services.services import Services
from companion.flight.services.settings import Settings
from companion.flight.services.vehicle_memory import identity_from, remember_vehicle
from companion.runtime.allocator import keep_memory
from companion.runtime.clock import WallOffset, now_ns
from companion.runtime.event import Event
from companion.runtime.ring_buffer import Recent
from companion.runtime.state_directory import StateDir
from params import Parameters
from slz import Report, Scan, TerrainMaps

if TYPE_CHECKING:
    from companion.flight.dashboard.page import Front, Page
    from companion.flight.foxglove.live_view import LiveView

log = logging.getLogger(__name__)

STEP_S = 0.05
ASK_AGAIN_S = 1.0  # for a mode that was refused
PATH_STEP_NS = 200_000_000
OPEN_STEP_NS = 200_000_000
# A heartbeat comes each second; without two of them nobody knows which mode the pilot has chosen.
HEARD_NS = 2_500_000_000
SWITCHED_NS = 2_500_000_000  # a pilot's switch explains a mode that shows so long after it
TELL_AGAIN_NS = 10_000_000_000  # of a mode that is still refused


class Companion:
    """The whole application.

    Parameters
    ----------
    mavlink_url, lidar_url
        As on the command line.
    auto
        Land without being asked.
    signing
        Signs the MAVLink link.
    state
        Where to remember what is set in flight; None forgets it.
    record
        File to record the flight in; it holds the data of the first sensor only.
    radar_url
        A radar beside the LiDAR; its points go into the same map.
    front
        Where to serve the pilot's page; None for nowhere.
    foxglove_port
        Port of this computer for Foxglove's live view; None for none.
    prior
        Folder of a survey to begin with (docs/survey.md).
    system
        The vehicle's MAVLink system; None: the only aircraft heard.

    Raises
    ------
    UsageError
        A URL is wrong or its port is in use, or the recording cannot be made.
    """

    def __init__(
        self,
        mavlink_url: str,
        lidar_url: str,
        parameters: Parameters,
        *,
        auto: bool,
        signing: Signing | None = None,
        state: StateDir | None = None,
        record: Path | None = None,
        radar_url: str | None = None,
        front: Front | None = None,
        foxglove_port: int | None = None,
        prior: Path | None = None,
        system: int | None = None,
    ) -> None:
        self.settings = Settings(parameters, state)
        self._record_into = record
        self.parameters = parameters = self.settings.live
        self.link = Link(mavlink_url, parameters, signing, identity_from(state, system))
        if state is not None:
            remember_vehicle(self.link, state)
        self.history = PoseHistory(parameters)
        self.executive = Executive(parameters, auto)
        self.operator = Operator(self.executive, self.situation, parameters.zone_m)
        self.link.on_command(OperatorCommands(self.operator, lambda: self.history.frame).answer)
        orders = (OrderParameters(self.operator),)
        self.services = Services(self.link, self.settings, signing, state, self._fresh_report, orders)
        self.link.on_reboot.subscribe(self.history.begin_anew)
        surveyed = None if prior is None else SurveyPrior(prior, parameters)
        self.worker = PipelineWorker(parameters, self._on_report, surveyed)
        self.worker.on_invalid.subscribe(self._on_invalid)
        self.assembler = ScanAssembler(parameters, self.history, self._on_scan)
        self._wall_offset_ns = WallOffset()
        self.lidar = open_lidar(
            lidar_url, parameters, self.assembler.add, self.link, wall_offset_ns=self._wall_offset_ns
        )
        self.recordings = Recordings(
            self.link, self.lidar.stream, self.worker, self.settings, self._wall_offset_ns, state,
            lambda: self.assembler.scans,
        )  # fmt: skip
        self.radar: Lidar | None = None
        if radar_url is not None:
            self.radar = open_beside(radar_url, parameters, self.history, self._on_radar_scan)
        self.fitness = Fitness(auto)
        self._memory = LandingMemory(state)
        self._restart = Restart(self._memory)
        self.obstacles = ObstacleMemory()
        echoes = lidar_url.partition(":")[0] == "mavlink"
        self.streams = Streams(
            self.link, self.history, self.obstacles, parameters, self._status, ranges=not echoes
        )
        self._watch = PointWatch()
        self.report: Report | None = None
        self.path_enu_m = Recent(20_000, (3,))
        self.zones_seen: set[int] = set()
        self.maps: TerrainMaps | None = None
        self.summary: dict[str, Any] = {}
        self._last_scan_ns: int | None = None
        self._last_report_ns: int | None = None
        self._last_path_ns = 0
        self._last_open_ns = 0
        self._mode_change: asyncio.Task[None] | None = None
        self._mode_wanted = ""
        self._refusals = 0  # of modes asked for, one after the other
        self._refusal_told_ns: int | None = None
        self.on_ready: Event[[]] = Event()
        self._stop = asyncio.Event()
        self._was_lost = False
        self._blocked = False
        self._flown = False
        self._epoch = self._map_epoch = self.history.epoch
        self._foxglove_port = foxglove_port
        self.live: LiveView | None = None
        self.page = None if front is None else _page(self, front)

    # ---- life -----------------------------------------------------------------------------------

    async def run(self) -> None:
        """Run until `stop`; any essential part that fails ends it with that part's error."""
        if self._record_into is not None:
            self.recordings.begin_flight(self._record_into)
        if self._foxglove_port is not None:
            self.live = _live_view(self, self._foxglove_port)
        self.link.on_certain.subscribe(self.history.trust)
        self.link.on_attitude.subscribe(self.history.add_attitude)
        self.link.on_position.subscribe(self.history.add_position)
        failed: BaseException | None = None
        try:
            async with asyncio.TaskGroup() as group:
                parts: dict[str, Coroutine[Any, Any, None]] = {
                    "link": self.link.run(),
                    "lidar": self.lidar.run(),
                    "services": self.services.run(),
                    "fitness": self.fitness.run(self.link, lambda: self.executive.phase in FLYING),
                    "ready": self._get_ready(),
                    "stopper": self._wait_for_stop(),
                }
                if self.radar is not None:
                    parts["radar"] = self.radar.run()
                if self.page is not None:
                    parts["page"] = self.page.run()
                for name, part in parts.items():
                    group.create_task(part, name=name)
        except* _Stopped:
            pass
        except* Exception as errors:
            failed = _first(errors)  # raised here, Python before 3.11.4 would wrap it in a group
        finally:
            gc.unfreeze()
            if self.page is not None:
                self.page.close()
            self.maps = self.worker.close()
            if self.live is not None:
                self.live.close()
            self.recordings.close()
            self.summary = flight_summary(self)
        if failed is not None:
            raise failed from None

    def stop(self) -> None:
        """End `run`, after telling whoever listens."""
        self._stop.set()

    async def _get_ready(self) -> None:
        """Warm up, then start deciding: nothing compiles in flight, and nothing commands before."""
        self.link.ready = False
        keep_memory()
        await self.worker.warm_up()
        gc.collect()
        gc.freeze()  # a full collection would stop the streams for a tenth of a second, for what stays anyway
        self.link.ready = True
        self.on_ready.emit()
        log.info("ready")
        async with asyncio.TaskGroup() as group:
            group.create_task(self.worker.run(), name="pipeline")
            group.create_task(self._decide(), name="executive")
            group.create_task(self.streams.run(), name="streams")

    async def _wait_for_stop(self) -> None:
        await self._stop.wait()
        flying = self.executive.phase in FLYING
        text = "SLZ: companion stops, take over" if flying else "SLZ: companion stops"
        self.link.statustext(text, Severity.CRITICAL.value if flying else Severity.NOTICE.value)
        if self._mode_change is not None:
            self._mode_change.cancel()
        if flying and self.link.vehicle.guided:
            self.link.send(velocity_setpoint(self.link.vehicle, np.zeros(3), None))
        await asyncio.sleep(0.2)
        await self.link.close()
        raise _Stopped

    # ---- data -----------------------------------------------------------------------------------

    def _on_scan(self, scan: Scan) -> None:
        if self.history.epoch != self._epoch:
            self._epoch = self.history.epoch
            self._map_anew()
            return  # it may still be of the frame before
        self._last_scan_ns = now_ns()
        for eye in (self.recordings.recorder, self.live):
            if eye is not None and (pose := self.history.latest(self._last_scan_ns)) is not None:
                eye.pose(pose, scan.frame)
        self.obstacles.add(scan)
        self._offer(scan)

    def _map_anew(self) -> None:
        """Begin a new map if the position estimate jumped."""
        if self.history.epoch == self._map_epoch:
            return
        log.warning("the position estimate jumped: mapping anew")
        self._begin_map()

    def _begin_map(self) -> None:
        self._map_epoch = self.history.epoch
        self.worker.restart()
        self.streams.forget()
        self.report = self._last_report_ns = None

    def _on_radar_scan(self, scan: Scan) -> None:
        """Map what the radar sees; its points come late and in blocks, so they are no obstacles at hand."""
        if self.history.epoch != self._epoch:
            return  # the next scan of the LiDAR, or the radar's own after it, begins the new map
        self._last_scan_ns = now_ns()
        self._offer(scan)

    def _offer(self, scan: Scan) -> None:
        """Map a scan, if this is the time for it."""
        if not self.link.ready:
            return  # a window would wait for the warm-up, and be late
        if self.executive.mapping and not self._stands_after_flight():
            self.worker.offer(scan, self.assembler.scans)
        else:
            self.worker.flush()

    def _stands_after_flight(self) -> bool:
        """Tell whether it has landed: from its skids it sees the ground at grazing angles only."""
        landed = self.link.vehicle.landed
        self._flown = self._flown or landed == "in_air"
        return self._flown and landed == "on_ground"

    def _on_report(self, report: Report) -> None:
        self.report = report
        if self.recordings.recorder is not None:
            self.recordings.recorder.report(report)
        if self.live is not None:
            self.live.report(report)
        self.streams.take(report)
        if self.page is not None:
            self.page.report(report)
        self._last_report_ns = now_ns()
        self.zones_seen.update(zone.id for zone in report.zones)
        news = self._watch.news(report)
        if news is not None and self.executive.phase is not Phase.FAILSAFE:  # nobody lands there
            log.info(news[1])
            self.link.statustext(news[1], news[0].value)

    def _on_invalid(self, reason: str) -> None:
        self.link.statustext(f"SLZ: map invalid: {reason}"[:50], Severity.CRITICAL.value)

    def situation(self) -> Situation:
        """Return what is known now, as the executive sees it."""
        now = now_ns()
        vehicle = self.link.vehicle
        pose = self.history.latest(now)
        fresh = self._report_is_fresh(now)
        landed = vehicle.landed
        return Situation(
            now_ns=now,
            connected=self.link.connected,
            armed=vehicle.armed,
            guided=vehicle.guided,
            landing=vehicle.landing,
            mode=vehicle.mode,
            on_ground=None if landed == "unknown" else landed == "on_ground",
            position_enu_m=None if pose is None else pose.position_enu_m,
            velocity_enu_ms=None if pose is None else pose.velocity_enu_ms,
            height_above_home_m=vehicle.relative_alt_m or 0.0,
            lidar_ok=self._scans_are_fresh(now) and fresh and not self.worker.invalid,
            report=self.report if fresh else None,
            selected=self.report.selected if fresh and self.report else None,
            battery_pct=vehicle.battery_pct,
            blocked=self._blocked,
            heard=self._mode_is_known(now),
            epoch=self.history.epoch if pose is None else pose.epoch,
            blind=self._blind(now),
            failsafe=vehicle.failsafe,
            breached=vehicle.health.breached,
            estimate_lost=vehicle.health.estimate_lost,
            gps_lost=vehicle.health.gps_lost,
            cause=vehicle.health.cause(now),
            target_lost_ns=vehicle.health.target_lost_ns,
            sticks_us=vehicle.health.sticks_us,
            switched=_is_recent(vehicle.health.switched_ns, now, SWITCHED_NS),
            fit=self.fitness.fit,
        )

    def _blind(self, now: int) -> str:
        """Return what is wrong while the ground is not seen: the link, the LiDAR or the computer."""
        if not self._mode_is_known(now) or self.history.latest(now) is None:
            return "link lost"  # scans wait for poses
        if not self._lidar_sends(now):
            return "LiDAR lost"
        if not self._scans_are_fresh(now):
            return "scans late"
        return "map invalid" if self.worker.invalid else "map late"

    def _mode_is_known(self, now: int) -> bool:
        heard_ns = self.link.vehicle.last_heartbeat_ns
        return _is_recent(heard_ns, now, HEARD_NS)

    def _mode_is_wanted(self) -> bool:
        """Tell whether the mode asked for is still to be: a landing broken off must not come late."""
        phase = self.executive.phase
        return phase is Phase.FINAL if self._mode_wanted == "land" else phase in FLYING

    def _mode_is_reached(self) -> bool:
        return self.link.vehicle.guided if self._mode_wanted == "guided" else self.link.vehicle.landing

    def _lidar_sends(self, now: int) -> bool:
        return _is_recent(self.lidar.last_arrival_ns, now, round(self.parameters.lidar_timeout_s * 1e9))

    def _scans_are_fresh(self, now: int) -> bool:
        """Tell whether something is seen, and the LiDAR sends: a radar sees for it, but not in its place."""
        stamps = [self._last_scan_ns]
        if self.radar is not None:
            stamps.append(self.lidar.last_arrival_ns)
        limit = self.parameters.lidar_timeout_s * 1e9
        return all(at_ns is not None and now - at_ns < limit for at_ns in stamps)

    def _report_is_fresh(self, now: int) -> bool:
        limit = (self.worker.window_s + self.parameters.window_s + 1.0) * 1e9
        return self._last_report_ns is not None and now - self._last_report_ns < limit

    def _fresh_report(self) -> Report | None:
        return self.report if self._report_is_fresh(now_ns()) and not self.worker.invalid else None

    # ---- decisions and streams ------------------------------------------------------------------

    async def _decide(self) -> None:
        """Step the executive at 20 Hz and carry out its orders."""
        loop = asyncio.get_running_loop()
        next_s = loop.time()
        while not self._stop.is_set():  # the stop's own setpoint is the last one
            self._tick()
            next_s = max(next_s + STEP_S, loop.time())
            await asyncio.sleep(next_s - loop.time())

    def _tick(self) -> None:
        self._map_anew()  # before the executive selects the point again, where it lies now
        if begin_frame_if_far(self):
            self._epoch = self.history.epoch  # what waits to be placed will be in the new frame
            self._begin_map()
            if self.page is not None:
                self.page.board.leave_path()
        situation = self.situation()
        orders = self.executive.step(situation)
        self._keep_in_mind(situation)
        for severity, text in orders.texts:
            log.info(text)
            self.link.statustext(text, severity.value)
        if orders.select_enu_m is not None:
            self.worker.select(orders.select_enu_m)
        if orders.mode is not None:
            self._change_mode(orders.mode)
        elif self._mode_change is not None and (
            not situation.heard or not self._mode_is_wanted() or self._mode_is_reached()
        ):
            self._mode_change.cancel()  # given up, or the pilot has it, may have it, or may change it now
        vehicle = self.link.vehicle
        if orders.velocity_enu_ms is not None and (vehicle.guided or orders.mode == "guided"):
            velocity = self._held_back(orders.velocity_enu_ms, situation)
            self.link.send(velocity_setpoint(vehicle, velocity, orders.yaw_rad))
        elif self._must_keep_offboard_open(situation) and (signal := offboard_signal(vehicle)) is not None:
            self.link.send(signal)
        self.streams.target_enu_m = orders.target_enu_m
        self._follow(situation)

    def _must_keep_offboard_open(self, situation: Situation) -> bool:
        """Tell whether a signal is due, without which PX4 does not enter its offboard mode."""
        px4, flying = self.link.vehicle.autopilot == "px4", situation.armed and situation.on_ground is False
        due = situation.now_ns - self._last_open_ns >= OPEN_STEP_NS
        if px4 and flying and due:
            self._last_open_ns = situation.now_ns
        return px4 and flying and due

    def _held_back(self, velocity_enu_ms: NDArray[np.float64], situation: Situation) -> NDArray[np.float64]:
        """Return the velocity that stops before what was seen ahead."""
        self._blocked = False
        pose = self.history.latest(situation.now_ns)
        if pose is None or not velocity_enu_ms.any():
            return velocity_enu_ms
        axes = enu_from_level(pose)
        around = self.streams.around_level_m(pose, situation.now_ns, LEVEL_M)
        velocity, self._blocked = held_back(velocity_enu_ms @ axes, around, self.parameters.lidar_min_m)
        return np.asarray(axes @ velocity)

    def _change_mode(self, kind: str) -> None:
        pending = self._mode_change is not None and not self._mode_change.done()
        if pending and kind == self._mode_wanted:
            return
        self._mode_wanted = kind
        px4 = self.link.vehicle.autopilot == "px4"
        mode = {"guided": "OFFBOARD" if px4 else "GUIDED", "land": "AUTO.PRECLAND" if px4 else "LAND"}[kind]
        self._mode_change = asyncio.create_task(self._set_mode(mode), name="set-mode")

    async def _set_mode(self, mode: str) -> None:
        result = await self.link.set_mode(mode)
        if result.ok:
            self._refusals = 0
        elif result.outcome != "superseded":
            log.warning("mode %s: %s", mode, result.outcome)
            self._tell_refusal(mode, now_ns())
            await asyncio.sleep(ASK_AGAIN_S)

    def _tell_refusal(self, mode: str, now: int) -> None:
        """Call the pilot when the second request for a mode fails: the first may have come too soon."""
        self._refusals += 1
        if self._refusals > 1 and not _is_recent(self._refusal_told_ns, now, TELL_AGAIN_NS):
            self._refusal_told_ns = now
            self.link.statustext(f"SLZ: {mode} refused: take over", Severity.CRITICAL.value)

    def _keep_in_mind(self, situation: Situation) -> None:
        """Keep the landing under way for a companion that is started after this one was killed."""
        vehicle, frame, executive = self.link.vehicle, self.history.frame, self.executive
        if not self._restart.decided:
            self._restart.step(situation, executive, frame, vehicle.sysid, vehicle.boot_ms)
            return
        if executive.phase not in FLYING:
            self._memory.keep(None)
        elif vehicle.sysid is not None and vehicle.boot_ms is not None:
            aim, nowhere = executive.aim_enu_m, (float("nan"),) * 3
            place = nowhere if aim is None or frame is None else frame.lla(aim)
            lat, lon, alt = (float(v) for v in place)
            phase = executive.phase.value
            self._memory.keep(Landing(phase, vehicle.sysid, vehicle.boot_ms, lat, lon, alt))

    def _status(self) -> Status:
        """Return what ground stations are told."""
        now, nan = now_ns(), float("nan")
        report = self.report if self._report_is_fresh(now) else None
        selected = None if report is None else report.selected
        best = report.zones[0] if report is not None and report.zones else None
        pose, latencies = self.history.latest(now), self.worker.latencies_ms
        over = nan if pose is None or selected is None else float(pose.position_enu_m[2]) - selected.height_m
        return Status(
            phase=self.executive.phase.value,
            zones=0 if report is None else len(report.zones),
            best_zone=nan if best is None else best.id,
            point="none" if selected is None else selected.state.value,
            certainty=selected.certainty if selected is not None else nan if best is None else best.certainty,
            height_m=over,
            latency_ms=float(latencies.last) if latencies else nan,
            dropped=self.worker.dropped_windows + self.link.statistics().dropped,
            sync_ms=self.link.timesync.residual_ns * 1e-6 if self.link.timesync.synced else nan,
        )

    def _follow(self, situation: Situation) -> None:
        """Keep the flown path, and note when the autopilot is lost and found."""
        if situation.position_enu_m is not None and situation.now_ns - self._last_path_ns >= PATH_STEP_NS:
            self._last_path_ns = situation.now_ns
            self.path_enu_m.append(situation.position_enu_m)
        lost = not situation.connected and self.link.vehicle.sysid is not None
        if lost != self._was_lost:
            self._was_lost = lost
            log.warning("autopilot lost" if lost else "autopilot is back")


def _is_recent(at_ns: int | None, now: int, limit_ns: int) -> bool:
    return at_ns is not None and now - at_ns < limit_ns


def _page(companion: Companion, front: Front) -> Page:
    from companion.flight.dashboard.page import Page  # the server's libraries only where they are used

    return Page(companion, front)


def _live_view(companion: Companion, port: int) -> LiveView:
    from companion.flight.foxglove.live_view import LiveView

    return LiveView(companion, port)


class _Stopped(Exception):  # noqa: N818 - not an error
    """Ends the task group after `stop`."""


def _first(errors: BaseExceptionGroup[BaseException]) -> BaseException:
    error: BaseException = errors
    while isinstance(error, BaseExceptionGroup):
        error = error.exceptions[0]
    return error
