"""State documents for the page, built in the companion's loop in a fraction of a millisecond."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from companion.flight.dashboard.freshness import AUTOPILOT, MAP, POSITION, VERDICT, with_ages
from companion.flight.flight_view import FlightView
from companion.flight.fusion.pose_history import PoseHistory
from companion.flight.geometry.axes import heading_rad
from companion.flight.geometry.geofence import Geofence
from companion.flight.geometry.pose import Pose
from companion.flight.geometry.wind import Wind
from companion.flight.landing.situation import COMMANDING, Emergency, Phase
from companion.flight.landing.ways.approach_path import ApproachPath
from companion.flight.link.vehicle_state import VehicleState
from companion.flight.sensors.diagnosis.lidar_diagnosis import LidarDiagnosis
from companion.flight.situation_source import HEARD_NS
from slz import MovingObject, Report, Wire

LATENCIES = 300
WIRE_STEP_M = 4.0
JUDGED_NS = 4_000_000_000  # a recording's report is past after this: windows of few returns last up to 2 s


def state(flight: FlightView) -> dict[str, Any]:
    """Return pose, phase and all values that may change from one tick to the next."""
    s = flight.deciding.situations.situation()
    pose = flight.sensing.history.latest(s.now_ns)
    vehicle, executive, parameters = flight.link.vehicle, flight.deciding.executive, flight.parameters
    aim, mismatch = executive.aim_enu_m, flight.link.key_mismatch
    outlook, lost = executive.outlook(s), executive.what_is_lost(s)
    low = s.battery_pct is not None and 0 < parameters.battery_land_pct >= s.battery_pct
    document = {
        "at_ns": s.now_ns,
        "phase": outlook.phase.value,
        "doing": outlook.doing,
        "abort_does": outlook.abort,
        "here": "" if executive.assist.now is None else executive.assist.now.text,
        "assist": parameters.assist,
        "flying": executive.phase in COMMANDING,
        "mode": s.mode,
        "guided": s.guided,
        "armed": s.armed,
        "on_ground": s.on_ground is True,
        "connected": s.connected,
        "heard": s.heard,
        "lidar_ok": s.lidar_ok,
        "blind": f"{lost} lost" if lost else s.no_map_reason.text,
        "lidar_faults": lidar_faults(flight.sensing.lidar.diagnosis),
        "failsafe": s.failsafe,
        "estimate_lost": s.estimate_lost,
        "gps": "lost" if s.gps_lost else "glitch" if s.gps_glitching else "",
        "blocked": s.blocked,
        "pipeline_failed": flight.mapping.latest.is_withdrawn,
        "battery_pct": s.battery_pct,
        "battery_v": vehicle.battery_v,
        "battery_low": low,
        "no_commands": s.no_command_reason,
        "key_mismatch": "" if mismatch is None else mismatch.value,
        "unfit": list(flight.deciding.fitness.texts),
        **_motion(pose),
        "wind": _wind(s.wind),
        "moving": [_moving(one, s.now_ns) for one in s.moving],
        "wires": _wires(flight.mapping.latest.newest),
        "fence": _fence(s.fence, executive.zones_beyond_fence(s)),
        "emergency": _emergency(executive.emergency(s)),
        **_ways(*executive.ways(s)),
        "height_m": _finite(flight.streams.height_m, 1),
        "height_home_m": _finite(s.height_above_home_m, 1),
        "aim_enu_m": None if aim is None else [_finite(v, 2) for v in aim],
        "aborts": executive.tally.aborts,
        "reboots": vehicle.reboots,
    }
    sources = {
        AUTOPILOT: (s.connected and s.heard, vehicle.last_heartbeat_ns),
        POSITION: (pose is not None, flight.sensing.history.bracketed_until_ns),
        MAP: (s.lidar_ok, s.judged_ns),
        VERDICT: (s.lidar_ok and not lost, s.judged_ns),
    }
    return with_ages(document, s.now_ns, sources)


def replayed(
    history: PoseHistory,
    vehicle: VehicleState,
    at_ns: int,
    diagnosis: LidarDiagnosis | None = None,
    judged_ns: int | None = None,
) -> dict[str, Any]:
    """Return the same document from a recording, as far as it holds the values.

    judged_ns: time of the newest report.
    """
    pose, heard_ns = history.latest(at_ns), vehicle.last_heartbeat_ns
    document = {
        "at_ns": at_ns,
        "phase": "replay",
        "doing": "",
        "abort_does": "",
        "here": "",
        "assist": "off",
        "flying": False,
        "mode": vehicle.mode,
        "guided": vehicle.guided,
        "armed": vehicle.armed,
        "on_ground": vehicle.landed == "on_ground",
        "connected": True,
        "heard": True,
        "lidar_ok": True,
        "blind": "no report",
        "lidar_faults": lidar_faults(diagnosis),
        "failsafe": vehicle.failsafe,
        "estimate_lost": vehicle.health.estimate_lost,
        "gps": "lost" if vehicle.health.gps_lost else "",
        "blocked": False,
        "pipeline_failed": False,
        "battery_pct": vehicle.battery_pct,
        "battery_v": vehicle.battery_v,
        "battery_low": False,
        "no_commands": vehicle.no_command_reason,
        "key_mismatch": "",
        "unfit": [],
        **_motion(pose),
        "wind": None,
        "moving": [],
        "wires": [],
        "fence": None,
        "emergency": None,
        **_ways(None, None),
        "height_m": None,
        "height_home_m": _finite(vehicle.relative_alt_m, 1),
        "aim_enu_m": None,
        "aborts": 0,
        "reboots": vehicle.reboots,
    }
    sources = {
        AUTOPILOT: (heard_ns is not None and at_ns - heard_ns < HEARD_NS, heard_ns),
        POSITION: (pose is not None, history.bracketed_until_ns),
        **dict.fromkeys((MAP, VERDICT), (judged_ns is not None and at_ns - judged_ns < JUDGED_NS, judged_ns)),
    }
    return with_ages(document, at_ns, sources)


def lidar_faults(diagnosis: LidarDiagnosis | None) -> list[dict[str, str]]:
    """Return what is wrong with the LiDAR now: cause and remedy in one sentence each."""
    active = [] if diagnosis is None else diagnosis.active
    return [{"cause": one.cause, "line": one.explanation.line} for one in active]


def _emergency(emergency: Emergency | None) -> dict[str, Any] | None:
    """Return where the emergency order would land, None without a zone."""
    if emergency is None:
        return None
    return {
        "zone": emergency.zone_id,
        "seconds": _finite(emergency.seconds, 0),
        "within_battery": emergency.within_battery,
    }


def _ways(inward: ApproachPath | None, outward: ApproachPath | None) -> dict[str, Any]:
    """Return bearing and slope of the best ways in and out of the selected point, None without one."""
    return {
        name: None if path is None else {"bearing_deg": path.bearing_deg, "slope_deg": path.slope_deg}
        for name, path in (("way_in", inward), ("way_out", outward))
    }


def _wind(wind: Wind | None) -> dict[str, Any] | None:
    """Return the wind: where it blows from, mean, gust and source."""
    if wind is None:
        return None
    return {
        "from_deg": round(math.degrees(wind.from_rad)) % 360,
        "speed_ms": round(wind.speed_ms, 1),
        "gust_ms": round(wind.gust_ms, 1),
        "source": wind.source,
    }


def _moving(one: MovingObject, now_ns: int) -> dict[str, Any]:
    """Return where something is that moves, its velocity and its size."""
    return {
        "number": one.number,
        "enu_m": _rounded(one.at(now_ns)),
        "velocity_ms": _rounded(one.velocity_ms),
        "radius_m": round(one.radius_m, 1),
        "height_m": round(one.height_m, 1),
    }


def _wires(report: Report | None) -> list[dict[str, Any]]:
    """Return wires as points along them: where they were seen, and where they go on."""
    out = []
    for wire in () if report is None else report.wires:
        points, _, seen = wire.sampled(WIRE_STEP_M)
        out.append(
            {
                "number": wire.number,
                "enu_m": [_rounded(point) for point in points],
                "seen": seen.tolist(),
                "over_m": _over_ground_m(report, wire),
            }
        )
    return out


def _fence(fence: Geofence, beyond: list[int]) -> dict[str, Any] | None:
    """Return boundaries and heights of the autopilot's fence, and the zones beyond it; None without one."""
    if fence.is_open:
        return None
    return {
        "boundaries": [
            {
                "corners_m": [_rounded(corner) for corner in one.corners_m],
                "radius_m": round(one.radius_m, 1),
                "inclusion": one.inclusion,
            }
            for one in fence.boundaries
        ],
        "margin_m": round(fence.margin_m, 1),
        "lowest_m": _finite(fence.lowest_m, 1),
        "highest_m": _finite(fence.highest_m, 1),
        "beyond": beyond,
    }


def _over_ground_m(report: Report | None, wire: Wire) -> float | None:
    """Return the height of the middle of a wire over the ground around the vehicle, None where unknown."""
    middle = wire.ends_enu_m.mean(axis=0)
    if report is None or report.nearby is None:
        return None
    return _finite(float(middle[2]) - report.nearby.ground_below_m(middle), 1)


def _motion(pose: Pose | None) -> dict[str, Any]:
    """Return position, velocity and attitude of the vehicle; all None if unknown."""
    east, north, up = (None, None, None) if pose is None else _rounded(pose.position_enu_m)
    roll, pitch, yaw = (None, None, None) if pose is None else _angles_deg(pose.rotation_enu_from_frd)
    return {
        "east_m": east,
        "north_m": north,
        "up_m": up,
        "velocity_enu_ms": None if pose is None else _rounded(pose.velocity_enu_ms),
        "roll_deg": roll,
        "pitch_deg": pitch,
        "yaw_deg": yaw,
    }


def landing(flight: FlightView) -> dict[str, Any] | None:
    """Return where the vehicle landed, in which zone and how far off the point; None before."""
    executive, frame = flight.deciding.executive, flight.sensing.history.frame
    tally = executive.tally
    if executive.phase is not Phase.LANDED or tally.landed_enu_m is None or frame is None:
        return None
    lat, lon, _ = (round(float(v), 7) for v in frame.lla(tally.landed_enu_m))
    return {"lat": lat, "lon": lon, "zone": tally.zone_id, "off_point_m": _finite(tally.off_point_m, 2)}


def health(flight: FlightView) -> dict[str, Any]:
    """Return rates, delays and losses of the program itself."""
    link = flight.link.statistics()
    lidar, fusion = flight.sensing.lidar.statistics(), flight.sensing.assembler.statistics()
    recorder = flight.recordings.recorder
    return {
        "ready": flight.link.ready,
        "autopilot": flight.link.vehicle.autopilot.name,
        "rates_hz": {name: round(rate, 1) for name, rate in link.rates_hz.items()},
        "missing": list(link.missing),
        "link_lost": link.lost,
        "link_bad": link.bad,
        "link_dropped": link.dropped,
        "delay_p99_ms": _finite(link.delay_p99_ms, 1),
        "sync_ms": _finite(link.residual_ms, 2) if flight.link.inbox.clock.timesync.synced else None,
        "windows": flight.mapping.worker.reports,
        "dropped_windows": flight.mapping.worker.dropped_windows,
        "ages_ms": np.median(flight.mapping.worker.ages_ms.array(LATENCIES), axis=1).round(1).tolist(),
        "window_s": round(flight.mapping.worker.window_s, 2),
        "computing_pct": round(flight.mapping.worker.computing_share * 100),
        "streams": flight.streams.statistics(),
        "lidar": {name: value for name, value in lidar.items() if isinstance(value, int | float | str)},
        "fusion": {name: value for name, value in fusion.items() if isinstance(value, int | float | str)},
        "recording": None if recorder is None else recorder.statistics(),
        "landing": landing(flight),
        "parameters": flight.settings.stored.model_dump(mode="json"),
    }


def _angles_deg(rotation_enu_from_frd: np.ndarray[Any, Any]) -> tuple[float, float, float]:
    """Return roll, pitch and heading clockwise from north, in degrees."""
    forward, right, down = rotation_enu_from_frd.T
    pitch = math.asin(max(-1.0, min(1.0, float(forward[2]))))
    roll = math.atan2(-float(right[2]), -float(down[2]))
    return (
        round(math.degrees(roll), 1),
        round(math.degrees(pitch), 1),
        round(math.degrees(heading_rad(rotation_enu_from_frd)) % 360, 1),
    )


def _rounded(vector: np.ndarray[Any, Any]) -> list[float]:
    return [round(float(v), 2) for v in vector]


def _finite(value: float | None, digits: int) -> float | None:
    return None if value is None or not math.isfinite(value) else round(float(value), digits)
