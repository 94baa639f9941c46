"""Entry point `python -m sitl`: the simulated vehicle as a program."""

from __future__ import annotations

import argparse
import json
import socket
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

from sitl import faults, intruders, scenes
from sitl.attached import attach
from sitl.autopilot.airframe import Kind
from sitl.autopilot.autopilot_kinds import KINDS, AutopilotKind
from sitl.autopilot.estimator import SEVERITIES, EstimateErrors
from sitl.pace import LockstepServer, Pace
from sitl.sensors import lidars
from sitl.sensors.imu.inertial_port import PORTS as IMU_PORTS
from sitl.sensors.lidar_port import Address
from sitl.sensors.particles import AIR
from sitl.signals import Ended, Signals
from sitl.simulation import DEFAULT_ORIGIN, Simulation
from sitl.truth import touchdown, truth
from sitl.vehicle.rotor_strike import Rotor
from sitl.wire.message_signing import read_key
from sitl.wire.wire import WireError

DEFAULT_MAVLINK = ["tcpin:127.0.0.1:5760", "udpout:127.0.0.1:14550"]
RANGES = {
    "duration": (0.0, 1e6),
    "speedup": (0.0, 1000.0),
    "point_rate": (1000.0, 2_000_000.0),
    "takeoff_alt": (0.5, 1000.0),
    "wind": (0.0, 50.0),
    "wind_from": (0.0, 360.0),
    "gust": (0.0, 20.0),
    "footprint": (0.1, 50.0),
    "slope_limit": (0.0, 90.0),
    "relief_limit": (0.0, 50.0),
    "gear_length": (0.05, 30.0),
    "gear_width": (0.05, 30.0),
    "pad_radius": (0.005, 2.0),
    "clearance": (0.02, 10.0),
    "tip_limit": (1.0, 60.0),
    "rotor_diameter": (0.05, 60.0),
    "rotor_height": (0.05, 30.0),
}


class _Parser(argparse.ArgumentParser):
    """Parser whose help states the default of each option, and whose errors are ours."""

    def add_argument(self, *names: str, **given: Any) -> argparse.Action:
        if (default := given.get("default")) not in (None, [], argparse.SUPPRESS):
            shown = f"{default:g}" if isinstance(default, float) else default
            given["help"] = f"{given['help']} [default: {shown}]"
        return super().add_argument(*names, **given)

    def error(self, message: str) -> None:  # type: ignore[override]
        raise _UsageError(message)


class _UsageError(ValueError):
    """Bad arguments."""


def main(arguments: list[str] | None = None) -> int:
    """Run until SIGTERM, SIGINT, the lock-step client's end, or the duration; return the exit code."""
    with Signals() as signals:
        try:
            return _run(sys.argv[1:] if arguments is None else arguments, signals)
        except Ended as ended:
            print("slz sim: ended by a signal; what was being done is left undone", file=sys.stderr)
            return ended.code


def _run(arguments: list[str], signals: Signals) -> int:
    try:
        options = _parse(arguments)
        _try_folder(options.truth)
        _write_metadata(options)
        program = _whole_vehicle(options) if options.autopilot is None else _lidar_alone(options)
    except (ValueError, WireError) as error:
        print(f"slz sim: {error}", file=sys.stderr)
        return 2
    return program(signals)


def _whole_vehicle(options: argparse.Namespace) -> Callable[[Signals], int]:
    simulation, server = _build(options)
    return lambda signals: _simulate(simulation, server, options, signals)


def _lidar_alone(options: argparse.Namespace) -> Callable[[Signals], int]:
    origin = None if options.origin is None else _origin(options.origin)
    attached = attach.build(options, origin, _lidar_to(options))
    if options.air != "clear" and attached.lidar is not None:
        lidars.fill_air(attached.lidar, options.air)
    return lambda signals: attach.follow(attached, options, signals)


def _simulate(
    simulation: Simulation, server: LockstepServer | None, options: argparse.Namespace, signals: Signals
) -> int:
    print(json.dumps(_ready(simulation, server)), flush=True)
    limit_ns = 1 << 62 if options.duration is None else round(options.duration * 1e9)

    def ended() -> bool:
        return signals.came or simulation.now_ns >= limit_ns

    # A lock-step client sets the pace itself, unless a speed is requested.
    speedup = options.speedup if options.speedup is not None else (1.0 if server is None else 0.0)
    pace = Pace(speedup, _say, ended)
    if server is None:  # a lock-step client waits for the simulated time, so that no scan is left out
        simulation.late_s = pace.late_s

    def step() -> int:
        now_ns = pace.keep(simulation.advance())
        pace.note_skipped(simulation.skipped_ns)
        return now_ns

    try:
        with signals.awaited():
            if server is not None:
                server.serve(step, ended)
                server.close()
            else:
                while not ended():
                    step()
    finally:
        simulation.close()
    if options.truth is not None:
        try:
            _write_truth(simulation, options)
        except OSError as error:
            print(f"slz sim: --truth {options.truth}: {error.strerror or error}", file=sys.stderr)
            return 1
    return 0


def _parse(arguments: list[str]) -> argparse.Namespace:
    parser = _Parser(prog="slz sim", description="A simulated vehicle with autopilot and LiDAR.")
    parser.add_argument("--scene", default="stadium", help=", ".join(scenes.NAMES))
    parser.add_argument(
        "--origin",
        default=None,
        metavar="LAT,LON,ALT",
        help=f"where the scene lies [default: {','.join(map(str, DEFAULT_ORIGIN))}; "
        "with --autopilot its home]",
    )
    parser.add_argument("--seed", type=int, default=1, help="of scene, wind and noise")
    parser.add_argument(
        "--lidar",
        default="mid360",
        choices=(*lidars.DEFAULTS, "none"),
        help="Livox Mid-360, Velodyne VLP-16, Ouster OS1-32 and OS0-64, LightWare SF45/B on a serial line, "
        "the paper's OPAL (sent as a Livox), flash or radar; all but mid360 and radar need "
        "--set lidar_pitch_deg=90",
    )
    parser.add_argument(
        "--lidar-to",
        default=None,
        metavar="HOST:PORT|DEVICE",
        help="where its packets go [default: 127.0.0.1 and the sensor's own port; "
        "for sf45 a pseudo-terminal, printed at the start]",
    )
    parser.add_argument(
        "--radar-to", default=None, metavar="HOST:PORT", help="an interferometric radar beside the LiDAR"
    )
    parser.add_argument(
        "--imu-to",
        default=None,
        metavar="HOST:PORT",
        help="send the packets of the IMU inside the LiDAR too; real ones go to port "
        + ", ".join(f"{port} ({name})" for name, port in IMU_PORTS.items()),
    )
    parser.add_argument(
        "--lidar-metadata", type=Path, default=None, metavar="FILE.json", help="write the Ouster's metadata"
    )
    parser.add_argument(
        "--dual", action="store_true", help="two returns of a pulse, by " + ", ".join(sorted(lidars.DUAL))
    )
    parser.add_argument("--air", default="clear", choices=tuple(AIR), help="what floats in the air")
    parser.add_argument("--point-rate", type=float, default=200_000.0, help="LiDAR points per second")
    parser.add_argument(
        "--mavlink",
        action="append",
        metavar="URL",
        help=f"repeatable; tcpin:, udpin:, udpout: or a device [default: {' and '.join(DEFAULT_MAVLINK)}]",
    )
    parser.add_argument(
        "--autopilot",
        metavar="URL",
        help="LiDAR only, on the vehicle of a running ArduCopter or PX4 SITL: tcp:HOST:PORT",
    )
    parser.add_argument(
        "--mavlink-key", type=Path, default=None, metavar="FILE", help="sign all MAVLink with this key"
    )
    parser.add_argument(
        "--lockstep",
        type=int,
        default=None,
        metavar="PORT",
        help="a client sets the pace; 0 takes a free port",
    )
    parser.add_argument(
        "--speedup",
        type=float,
        default=None,
        help="times real time; 0 is as fast as possible [default: 1; with --lockstep 0]",
    )
    parser.add_argument("--pilot", default="none", choices=("none", "takeoff"), help="who arms and takes off")
    parser.add_argument(
        "--autopilot-kind", default="ardupilot", choices=tuple(KINDS),
        help="whose modes, messages and failsafes the simulated autopilot has",
    )  # fmt: skip
    parser.add_argument(
        "--airframe", default="multirotor", choices=[kind.name.lower() for kind in Kind],
        help="what the messages say it is; a fixed wing flies straight on at 9.6 m/s after its take-off",
    )  # fmt: skip
    parser.add_argument("--takeoff-alt", type=float, default=30.0, help="m above home")
    parser.add_argument("--wind", type=float, default=3.0, help="mean wind 10 m over the ground, m/s")
    parser.add_argument(
        "--wind-from",
        type=float,
        default=None,
        metavar="DEG",
        help="where it blows from [default: drawn by the seed]",
    )
    parser.add_argument(
        "--gust",
        type=float,
        default=None,
        metavar="M/S",
        help="standard deviation [default: a third of the mean]",
    )
    parser.add_argument(
        "--intruder",
        default="none",
        metavar="none|KIND@HEIGHT,...",
        help="what comes to the landing below a height: " + ", ".join(intruders.KINDS),
    )
    parser.add_argument(
        "--fault",
        default="none",
        metavar="none|NAME[=SIZE]@HEIGHT,...",
        help="faults that begin below a height in the descent: "
        + ", ".join(faults.AT_HEIGHT)
        + "; with a size: "
        + ", ".join(faults.SIZED),
    )
    parser.add_argument(
        "--param",
        action="append",
        default=[],
        metavar="NAME=VALUE",
        help="parameter of the autopilot, repeatable; EKF2_EN=1 gives it PX4's filter",
    )
    parser.add_argument(
        "--drift", default="none", choices=tuple(SEVERITIES), help="random walk of the position estimate"
    )
    parser.add_argument(
        "--duration",
        type=float,
        default=None,
        help="simulated seconds; with --autopilot real ones [default: no end]",
    )
    parser.add_argument(
        "--truth", type=Path, default=None, metavar="DIR", help="write truth files at the end"
    )
    parser.add_argument("--footprint", type=float, default=2.0, help="vehicle footprint of the truth, m")
    parser.add_argument(
        "--slope-limit", type=float, default=10.0, help="steepest safe ground of the truth, degrees"
    )
    parser.add_argument("--relief-limit", type=float, default=0.3, help="highest safe step, m")
    touchdown.add_gear_options(parser)
    options = parser.parse_args(arguments)
    if options.autopilot is not None:
        attach.refuse_foreign(options, parser.get_default)
    _check(options)
    if options.lidar_to is None:
        options.lidar_to = lidars.DEFAULTS.get(options.lidar)
    return options


def _check(options: argparse.Namespace) -> None:
    """Refuse meaningless numbers before anything is opened."""
    if options.scene not in scenes.NAMES:
        raise _UsageError(f"--scene {options.scene!r}: there are {', '.join(scenes.NAMES)}")
    if options.seed < 0:
        raise _UsageError(f"--seed {options.seed}: must not be negative")
    if options.lockstep is not None and not 0 <= options.lockstep < 65536:
        raise _UsageError(f"--lockstep {options.lockstep}: a port is at most 65535")
    for name, (low, high) in RANGES.items():
        value = getattr(options, name)
        if value is not None and not low <= value <= high:
            raise _UsageError(
                f"--{name.replace('_', '-')} {value:g}: must be a number from {low:g} to {high:.10g}"
            )
    if options.lidar_metadata is not None and options.lidar not in lidars.OUSTERS:
        raise _UsageError("--lidar-metadata: only --lidar ouster has metadata, and os0")
    if options.dual and options.lidar not in lidars.DUAL:
        raise _UsageError(f"--dual: only --lidar {', '.join(sorted(lidars.DUAL))} can send two returns")
    _check_rate(options.point_rate, options.lidar)


def _check_rate(rate: float, lidar: str) -> None:
    """Refuse a rate at which the LiDAR cannot fire, and name the nearest possible ones."""
    if not rate.is_integer():
        raise _UsageError(f"--point-rate {rate:.10g}: must be a whole number")
    if lidar in lidars.PERIODIC and 10**9 % int(rate):
        below, above = lidars.rates_beside(int(rate))
        raise _UsageError(
            f"--point-rate {rate:.10g}: --lidar {lidar} fires every so many whole nanoseconds, so the rate "
            f"must be one that divides 10^9: {below} or {above}"
        )


def _build(options: argparse.Namespace) -> tuple[Simulation, LockstepServer | None]:
    coming = intruders.read(options.intruder, options.seed)
    breaking = faults.read(options.fault, options.seed)
    simulation = Simulation.build(
        options.scene,
        mavlink=options.mavlink or DEFAULT_MAVLINK,
        seed=options.seed,
        origin_lla=_origin(options.origin),
        lidar="mid360" if options.lidar == "none" else options.lidar,
        lidar_to=_lidar_to(options),
        point_rate_hz=round(options.point_rate),
        lidar_dual=options.dual,
        autopilot_kind=options.autopilot_kind,
        parameters=_parameters(options.param, KINDS[options.autopilot_kind]),
        errors=EstimateErrors.of_severity(options.drift),
        wind_ms=options.wind,
        wind_from_deg=options.wind_from,
        gust_ms=options.gust,
        pilot_height_m=options.takeoff_alt if options.pilot == "takeoff" else None,
        mavlink_key=None if options.mavlink_key is None else read_key(options.mavlink_key),
        airframe=Kind[options.airframe.upper()],
        imu_to=None if options.imu_to is None else _address(options.imu_to, "--imu-to"),
        radar_to=None if options.radar_to is None else _address(options.radar_to, "--radar-to"),
    )
    simulation.intruders = coming
    simulation.every_tick.extend(breaking)
    if options.air != "clear" and simulation.lidar is not None:
        simulation.fill_air(options.air)
    simulation.rotor = Rotor(options.rotor_diameter / 2, options.rotor_height)
    simulation.log.gear, simulation.log.tip_limit_deg = touchdown.chosen_gear(options), options.tip_limit
    try:
        return simulation, None if options.lockstep is None else LockstepServer(options.lockstep)
    except WireError:
        simulation.close()
        raise


def _origin(text: str | None) -> tuple[float, float, float]:
    if text is None:
        return DEFAULT_ORIGIN
    try:
        lat, lon, alt = (float(part) for part in text.split(","))
    except ValueError:
        raise ValueError(f"--origin {text!r}: write LAT,LON,ALT in degrees and metres") from None
    if not (abs(lat) <= 90 and abs(lon) <= 180 and -1000 < alt < 10_000):
        raise ValueError(f"--origin {text!r} is not on the Earth")
    return lat, lon, alt


def _parameters(texts: list[str], kind: AutopilotKind) -> dict[str, float]:
    given = {}
    for text in texts:
        name, _, value = text.partition("=")
        try:
            given[name] = float(value)
        except ValueError:
            raise ValueError(f"--param {text!r}: write NAME=VALUE") from None
    known = kind.known(given)
    for name, number in given.items():
        if name not in known or not kind.in_range(name, number):
            raise ValueError(f"--param {name}={number:g}: the autopilot has no such parameter or value")
    return given


def _lidar_to(options: argparse.Namespace) -> Address | None:
    if options.lidar == "none":
        return None
    return str(options.lidar_to) if options.lidar == "sf45" else _address(options.lidar_to)


def _address(text: str, option: str = "--lidar-to") -> tuple[str, int]:
    host, _, port = text.rpartition(":")
    if not host or not (port.isascii() and port.isdecimal()) or not 0 < int(port) < 65536:
        raise ValueError(f"{option} {text!r}: write HOST:PORT")
    try:
        found = socket.getaddrinfo(host, int(port), socket.AF_INET, socket.SOCK_DGRAM)
    except (OSError, UnicodeError):
        raise ValueError(f"{option} {text!r}: the host is unknown") from None
    return str(found[0][4][0]), int(port)


def _try_folder(folder: Path | None) -> None:
    """Refuse a folder for the truth that cannot be created or written, before the flight begins."""
    if folder is None:
        return
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            pass
    except OSError as error:
        raise _UsageError(f"--truth {folder}: {error.strerror or error}") from None


def _write_metadata(options: argparse.Namespace) -> None:
    """Write the Ouster's metadata, which its driver needs."""
    path = options.lidar_metadata
    if path is None:
        return
    try:
        path.write_text(lidars.OUSTERS[options.lidar].metadata(options.dual))
    except OSError as error:
        raise _UsageError(f"--lidar-metadata {path}: {error.strerror or error}") from None


def _ready(simulation: Simulation, server: LockstepServer | None) -> dict[str, object]:
    names = [wire.name for wire in simulation.router.wires if wire.name != "pilot"]
    return {
        "ready": True,
        "mavlink": names,
        "lidar": None if simulation.lidar is None else simulation.lidar.name,
        "lockstep": None if server is None else server.port,
    }


def _say(line: str) -> None:
    print(f"slz sim: {line}", file=sys.stderr, flush=True)


def _write_truth(simulation: Simulation, options: argparse.Namespace) -> None:
    print(f"slz sim: writing {options.truth}; a signal ends it without", file=sys.stderr, flush=True)
    simulation.log.write(options.truth)
    truth.write(
        options.truth,
        simulation.scene,
        simulation.origin_lla,
        footprint_m=options.footprint,
        slope_limit_deg=options.slope_limit,
        relief_limit_m=options.relief_limit,
    )


if __name__ == "__main__":
    sys.exit(main())
