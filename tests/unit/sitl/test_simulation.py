"""Whole simulation under one clock, in this process and as a program."""

from __future__ import annotations

import json
import signal
import socket
from collections.abc import Iterator
from contextlib import closing, contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from sitl import __main__ as program
from sitl import scenes
from sitl.autopilot.estimator import EstimateErrors
from sitl.autopilot.modes import Mode
from sitl.intruders import DrivenCar, Intruder, SwungJib
from sitl.pace import Pace
from sitl.simulation import TICK_NS, PoseTrack, Simulation
from sitl.truth.standing_gear import gear_of
from sitl.vehicle.rigid_body import from_euler
from sitl.wire.wire import MemoryWire
from sitl.world.primitives import Box
from tests.unit.sitl.wire.test_wire import COMPANION, STATION, Station, command

CLOUD_HEADER_BYTES = 36


@contextmanager
def simulation(*ends: Station, seed: int = 1, **more: Any) -> Iterator[Simulation]:
    with closing(Simulation(scenes.build("plain", seed), [e.wire for e in ends], seed=seed, **more)) as made:
        yield made


def raw(wire: MemoryWire) -> bytes:
    return b"".join(wire.received)


# ---- the clock -----------------------------------------------------------------------------------------


def test_a_tick_is_two_and_a_half_milliseconds_and_hooks_run_after_each() -> None:
    with simulation() as s:
        seen: list[int] = []
        s.every_tick.append(lambda s: seen.append(s.now_ns))
        assert [s.advance() for _ in range(4)] == [TICK_NS * k for k in (1, 2, 3, 4)]
        assert seen == [2_500_000, 5_000_000, 7_500_000, 10_000_000]


def test_the_same_seed_flies_and_tells_the_same_to_the_last_byte() -> None:
    def flight(seed: int) -> tuple[bytes, bytes]:
        end = Station(*STATION)
        with simulation(end, seed=seed, pilot_height_m=10.0) as s:
            s.run(10)
            return raw(end.wire), s.vehicle.truth.pos_enu_m.tobytes()

    assert flight(1) == flight(1)
    assert flight(1)[1] != flight(2)[1]


def test_a_question_is_answered_in_the_tick_it_has_arrived_before() -> None:
    end = Station(*STATION)
    with simulation(end) as s:
        s.run(1)
        end.heard()
        asked_ns = s.autopilot.boot_offset_ns + s.now_ns
        end.send(mavlink.MAVLink_timesync_message(0, 12345))
        s.advance()
        (answer,) = [m for m in end.heard() if m.get_type() == "TIMESYNC"]
        assert answer.ts1 == 12345
        assert asked_ns <= answer.tc1 <= asked_ns + TICK_NS


# ---- flights -------------------------------------------------------------------------------------------


def test_the_pilot_takes_off_and_holds_its_height_by_messages_alone() -> None:
    end = Station(*STATION)
    with simulation(end, pilot_height_m=12.0) as s:
        s.run(30)
        assert s.pilot is not None
        assert s.pilot.done
        assert s.autopilot.mode is Mode.GUIDED
        assert s.autopilot.height_above_home_m == pytest.approx(12, abs=0.5)
        assert s.vehicle.truth.pos_enu_m[2] == pytest.approx(12, abs=1.5)
        assert s.log.takeoff is not None
        assert s.touchdown is None
        assert {"HEARTBEAT", "GLOBAL_POSITION_INT", "ATTITUDE"} <= set(end.kinds())


def test_a_station_commands_the_companion_through_the_autopilot() -> None:
    station, companion = Station(*STATION), Station(1, COMPANION)
    with simulation(station, companion) as s:
        beat = mavlink.MAVLink_heartbeat_message(18, 8, 0, 0, 4, 3)
        companion.send(beat)
        station.send(beat)
        s.advance()
        companion.heard()
        station.send(command(1, COMPANION))
        s.advance()
        asked = [m for m in companion.heard() if m.get_type() == "COMMAND_LONG"]
        companion.send(mavlink.MAVLink_command_ack_message(asked[0].command, 0, 0, 0, *STATION))
        s.advance()
        (ack,) = [m for m in station.heard() if m.get_type() == "COMMAND_ACK"]
        assert (ack.get_srcComponent(), len(asked)) == (COMPANION, 1)


def landing(s: Simulation, companion: Station, spot_enu_m: tuple[float, float, float]) -> None:
    """Stream a BODY_FRD landing target at 20 Hz from a companion that knows the truth."""
    truth = s.vehicle.truth
    w, x, y, z = truth.quat_wxyz
    turn = np.array([
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ])  # fmt: skip
    east, north, up = np.array(spot_enu_m) - truth.pos_enu_m
    body = turn.T @ [north, east, -up]
    companion.send(
        mavlink.MAVLink_landing_target_message(
            s.now_ns // 1000, 0, mavlink.MAV_FRAME_BODY_FRD, 0, 0, float(np.linalg.norm(body)), 0, 0,
            *(float(v) for v in body), [1, 0, 0, 0], 0, 1,
        )
    )  # fmt: skip


def flown_onto(spot: tuple[float, float, float], *coming: Intruder) -> Simulation:
    companion = Station(1, COMPANION)
    with simulation(companion, pilot_height_m=20.0, errors=EstimateErrors.none(), wind_ms=0.0) as s:
        s.intruders = list(coming)
        s.run(22)
        s.every_tick.append(lambda s: landing(s, companion, spot) if s.now_ns % 50_000_000 == 0 else None)
        s.run(3)
        assert s.pilot is not None
        s.pilot.set_mode(Mode.LAND)
        s.run(45)
        return s


def test_a_landing_is_written_down_as_it_truly_was() -> None:
    s = flown_onto((3.0, 2.0, 0.0))
    document = json.loads(json.dumps(s.log.document()))
    touch = document["touchdown"]
    assert np.hypot(touch["e"] - 3, touch["n"] - 2) < 0.3
    assert 0.2 < touch["sink_ms"] < 1.0
    assert touch["tilt_deg"] < 5
    # A tenth of an arc second is 3 m.
    assert touch["lat"] == pytest.approx(s.origin_lla[0] + touch["n"] / 111_177, abs=1e-7)
    assert document["takeoff"]["t"] < touch["t"]
    assert [m["mode"] for m in document["modes"]] == ["GUIDED", "LAND"]
    assert document["armed_at_end"] is False
    steps = np.diff(np.array([p["t"] for p in document["trajectory"]], np.float64))
    np.testing.assert_allclose(steps, 0.2, atol=1e-6)
    assert {p["mode"] for p in document["trajectory"]} >= {"STABILIZE", "GUIDED", "LAND"}


def test_a_landing_is_judged_by_how_its_gear_stands() -> None:
    s = flown_onto((3.0, 2.0, 0.0))
    level = s.log.document()["touchdown"]
    assert level["footing"]["fault"] == ""
    assert level["footing"]["tilt_deg"] < 3.0
    # A slab under the pads ahead, across the heading.
    turn = np.radians(level["heading_deg"])
    ahead = level["e"] + 0.9 * np.sin(turn), level["n"] + 0.9 * np.cos(turn)
    s.scene.world.add_mover("slab", (Box(0, 0, 0, 1.4, 3.0, 0.2, name="top"),), *ahead, np.pi / 2 - turn)
    found = json.loads(json.dumps(s.log.document()))["touchdown"]["footing"]
    assert found["tilt_deg"] == pytest.approx(19.3, abs=2.0)
    assert found["fault"] == f"stands at {found['tilt_deg']:.1f} degrees on its gear"
    s.log.tip_limit_deg = 30.0
    assert s.log.document()["touchdown"]["footing"]["fault"] == ""
    s.log.gear = gear_of("tripod", 5.0, 0.57)
    assert s.log.document()["touchdown"]["footing"]["tilt_deg"] < 5.0


def test_the_intruder_drives_onto_the_landing_point_while_the_vehicle_is_low() -> None:
    s = flown_onto((3.0, 2.0, 0.0), DrivenCar(15.0))
    starts, stands = s.log.events
    assert np.hypot(starts["e"] - 3, starts["n"] - 2) == pytest.approx(25, abs=0.5)
    assert np.hypot(stands["e"] - 3, stands["n"] - 2) < 0.5
    assert stands["t"] - starts["t"] == pytest.approx(25 / 6, abs=0.1)
    at_start = min(s.log.trajectory, key=lambda p: abs(p["t"] - starts["t"]))
    assert at_start["u"] == pytest.approx(15, abs=1.0)
    ground = s.scene.world.height_m(stands["e"], stands["n"])
    assert ground > 1.0, "no car stands there"


def test_a_jib_swings_over_the_vehicle_and_hurts_nobody_who_stays_below() -> None:
    s = flown_onto((3.0, 2.0, 0.0), SwungJib(12.0))
    starts, hangs = s.log.events
    assert (starts["event"], hangs["event"]) == ("jib starts", "jib on the landing point")
    assert hangs["t"] - starts["t"] == pytest.approx(np.radians(40) / 0.08, abs=0.1)
    under_m = s.scene.world.height_m(3.0, 2.0) - 1.2
    assert under_m == pytest.approx(17, abs=1.0)
    assert s.vehicle.collision is None
    assert s.touchdown is not None


def test_a_vehicle_that_climbs_into_a_jib_crashes() -> None:
    with simulation(pilot_height_m=20.0, errors=EstimateErrors.none(), wind_ms=0.0) as s:
        x, y, z = s.vehicle.truth.pos_enu_m
        s.scene.world.add_mover("jib", (Box(0, 0, 8.0, 10.0, 1.2, 1.2, name="beam"),), x, y, 0.5)
        s.run(22)
        assert s.vehicle.collision is not None
        assert s.vehicle.collision["u"] - z == pytest.approx(8.0 - 0.3, abs=0.15)
        assert not s.autopilot.armed
        s.run(5)
        assert s.vehicle.truth.pos_enu_m[2] == pytest.approx(z, abs=0.1)


# ---- the LiDAR -----------------------------------------------------------------------------------------


@contextmanager
def ear() -> Iterator[socket.socket]:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as made:
        made.bind(("127.0.0.1", 0))
        made.setblocking(False)
        yield made


def drained(made: socket.socket) -> list[bytes]:
    got: list[bytes] = []
    while True:
        try:
            got.append(made.recv(2000))
        except BlockingIOError:
            return got


def test_lidar_points_arrive_at_their_rate_and_can_be_turned_off_and_on() -> None:
    with ear() as far, simulation(lidar_to=far.getsockname(), point_rate_hz=10_000) as s:

        def points(seconds: float) -> int:
            s.run(seconds)
            return sum((len(data) - CLOUD_HEADER_BYTES) // 14 for data in drained(far))

        assert points(0.5) == pytest.approx(5_000, abs=192)
        s.lidar_on = False
        assert points(0.5) == 0
        s.lidar_on = True
        assert points(0.5) == pytest.approx(5_000, abs=192)


def test_a_lidar_nobody_listens_to_does_no_harm() -> None:
    with ear() as far:
        address = far.getsockname()
    with simulation(lidar_to=address, point_rate_hz=10_000) as s:
        s.run(0.2)
        assert s.now_ns == 200_000_000


def test_poses_between_ticks_are_interpolated_along_the_shorter_turn() -> None:
    track = PoseTrack()
    track.add(0, np.array([0.0, 0, 10]), from_euler(0, 0, 0.1))
    track.add(10, np.array([1.0, 2, 12]), -from_euler(0, 0, 0.3))
    position, quat = track.at(np.array([0, 5, 10], np.int64))
    np.testing.assert_allclose(position, np.array([[0.0, 0, 10], [0.5, 1, 11], [1, 2, 12]]))
    np.testing.assert_allclose(np.linalg.norm(quat, axis=1), 1)
    for row, yaw in zip(quat, (0.1, 0.2, 0.3), strict=True):
        assert abs(row @ from_euler(0, 0, yaw)) == pytest.approx(1, abs=1e-9)
    track.keep_last()
    assert track.stamps == [10]


# ---- the program ---------------------------------------------------------------------------------------


@pytest.fixture
def signals() -> Iterator[None]:
    before = [(number, signal.getsignal(number)) for number in (signal.SIGTERM, signal.SIGINT)]
    yield
    for number, handler in before:
        signal.signal(number, handler)


@pytest.mark.parametrize(("arguments", "word"), [
    ("--scene moon", "moon"), ("--origin 91,0,0", "91,0,0"), ("--origin here", "here"),
    ("--mavlink tcp:1", "tcp:1"), ("--lidar-to nowhere", "nowhere"), ("--speedup nan", "--speedup"),
    ("--speedup -1", "--speedup"), ("--duration -1", "--duration"), ("--seed -1", "--seed"),
    ("--lockstep 70000", "70000"), ("--intruder cow@15", "cow@15"), ("--intruder car@0", "car@0"),
    ("--point-rate 0", "--point-rate"), ("--takeoff-alt nan", "--takeoff-alt"), ("--lidar sonar", "sonar"),
    ("--what", "--what"), ("--duration inf", "--duration"), ("--point-rate 9600", "9600"),
    ("--speedup inf", "--speedup inf: must be a number from 0 to 1000"), ("--intruder car@nan", "car@nan"),
    ("--intruder car@1e9", "up to 200 m"), ("--intruder car@9,jib", "car@9,jib"),
    ("--intruder car@9,car@8", "each once"), ("--rotor-diameter 0", "--rotor-diameter"),
    ("--intruder car@201", "car@201"), ("--takeoff-alt 1001", "1000"),
    ("--wind 51", "from 0 to 50"), ("--wind nan", "--wind nan"), ("--wind-from 361", "from 0 to 360"),
    ("--gust -1", "from 0 to 20"), ("--footprint inf", "--footprint inf"),
    ("--point-rate 1e12", "from 1000 to 2000000"), ("--point-rate inf", "from 1000"),
    ("--point-rate 20000.5", "20000.5"), ("--lidar-to nowhere.invalid:1", "nowhere.invalid"),
    ("--lidar-metadata os1.json", "only --lidar ouster"), ("--radar-to nowhere", "--radar-to"),
    ("--point-rate 30000", "25000 or 31250"), ("--point-rate 30000 --lidar opal", "25000 or 31250"),
    ("--tip-limit 0", "from 1 to 60"), ("--clearance nan", "--clearance nan"), ("--gear none", "none"),
    ("--lidar ouster --lidar-metadata /no/such/folder/os1.json", "/no/such/folder"),
])  # fmt: skip
def test_bad_usage_is_one_line_and_exit_code_2(
    arguments: str, word: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert program.main(arguments.split()) == 2
    out, err = capsys.readouterr()
    assert (out, err.count("\n")) == ("", 1)
    assert word in err


def test_a_mavlink_port_in_use_is_exit_code_2(capsys: pytest.CaptureFixture[str]) -> None:
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen(1)
        port = taken.getsockname()[1]
        assert program.main(["--scene", "plain", "--mavlink", f"tcpin:127.0.0.1:{port}"]) == 2
    assert f"tcpin:127.0.0.1:{port}: the port is in use" in capsys.readouterr().err


@pytest.mark.parametrize(
    "more", [["--mavlink", "nonsense"], ["--point-rate", "9600"], ["--lockstep", "TAKEN"]]
)
def test_what_was_opened_is_closed_when_the_rest_is_refused(more: list[str]) -> None:
    with socket.socket() as taken, socket.socket() as again:
        taken.bind(("127.0.0.1", 0))
        taken.listen(1)
        again.bind(("127.0.0.1", 0))
        port = again.getsockname()[1]
        again.close()
        more = [str(taken.getsockname()[1]) if word == "TAKEN" else word for word in more]
        assert program.main(["--scene", "plain", "--mavlink", f"tcpin:127.0.0.1:{port}", *more]) == 2
        with socket.socket() as free:
            free.bind(("127.0.0.1", port))


QUIET = ["--scene", "plain", "--lidar", "none", "--mavlink", "tcpin:127.0.0.1:0"]
RUN = [*QUIET, "--speedup", "0", "--duration", "0.5"]


def test_it_says_once_that_it_is_ready_and_ends_after_its_duration(
    capsys: pytest.CaptureFixture[str], signals: None
) -> None:
    assert program.main(RUN) == 0
    (line,) = capsys.readouterr().out.splitlines()
    ready = json.loads(line)
    assert (ready["ready"], ready["lidar"], ready["lockstep"]) == (True, None, None)
    (url,) = ready["mavlink"]
    assert url.startswith("tcpin:127.0.0.1:")
    assert not url.endswith(":0")


@pytest.mark.parametrize(
    ("lidar", "port"), [("mid360", 56301), ("vlp16", 2368), ("ouster", 7502), ("opal", 56301)]
)
def test_each_lidar_sends_to_its_own_port(
    capsys: pytest.CaptureFixture[str], signals: None, lidar: str, port: int
) -> None:
    assert program.main([*RUN, "--lidar", lidar]) == 0
    (line,) = capsys.readouterr().out.splitlines()
    assert json.loads(line)["lidar"] == f"127.0.0.1:{port}"


def test_the_ouster_s_metadata_is_written(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], signals: None
) -> None:
    file = tmp_path / "os1.json"
    assert program.main([*RUN, "--lidar", "ouster", "--lidar-metadata", str(file)]) == 0
    assert json.loads(file.read_text())["lidar_data_format"]["pixels_per_column"] == 32


def test_a_truth_folder_that_cannot_be_made_is_refused_at_the_start(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "file").write_text("in the way")
    folder = tmp_path / "file" / "truth"
    assert program.main([*RUN, "--truth", str(folder)]) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert str(folder) in err
    assert err.count("\n") == 1


@pytest.mark.parametrize(("lockstep", "asked", "pace"), [
    (False, [], 1.0), (True, [], 0.0), (False, ["--speedup", "3"], 3.0), (True, ["--speedup", "3"], 3.0),
])  # fmt: skip
def test_a_lockstep_client_sets_the_pace_unless_a_speed_is_asked_for(
    lockstep: bool, asked: list[str], pace: float, monkeypatch: pytest.MonkeyPatch, signals: None
) -> None:
    paces: list[float] = []

    def paced(wanted: float, *_: Any) -> Pace:
        paces.append(wanted)
        return Pace(0.0)

    monkeypatch.setattr(program, "Pace", paced)
    assert program.main([*QUIET, "--duration", "0", *asked, *(["--lockstep", "0"] if lockstep else [])]) == 0
    assert paces == [pace]
