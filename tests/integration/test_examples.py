"""The examples of the documentation run, and say what they should."""

from __future__ import annotations

import asyncio
import os
import runpy
import socket
import struct
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
import pytest

from companion.desk.open_benchmark.landing_task import SAFE, UNSAFE
from companion.desk.open_benchmark.methods import method_of_file
from companion.flight.app import Companion
from companion.flight.landing.situation import Phase
from companion.flight.sensing import Sources
from companion.flight.sensors import sensor_registry
from companion.flight.sensors.lidar_url import open_lidar
from companion.flight.sensors.returns import Returns
from companion.runtime.lockstep_loop import LockstepLoop
from params import Parameters
from sitl.simulation import Simulation
from sitl.truth.touchdown import fault_of
from tests import REPOSITORY
from tests.ports import free_port
from tests.unit.companion.desk.open_benchmark.flights_over import SMALL, flight
from tests.unit.companion.desk.replay.flights import recorded, with_windows, write_own
from tests.unit.companion.flight.ros2.test_ros_node import node_and_listener, report_with

EXAMPLES = REPOSITORY / "docs" / "examples"
NAMES = sorted(path.stem for path in EXAMPLES.glob("*.py"))
PLAIN = {  # what each prints, among others
    "zones_from_array": "zone 1: 1959 m2, slope 0.2 degrees",
    "plot_certainty": "after 3 s: greatest certainty 1.00, best zone 0.97",
    "slope_and_roughness": "meadow: slope 8.0 degrees, roughness 0.7 cm",
    "wires_in_cloud": "wire of 266 returns from -22 to 22 m east, 8.8 m up at its end",
    "flash_hazards": "2.0 m high, at 4.0 m east and -0.1 m north",
    "known_ground": "seen by the vehicle: 258 m2, certainty 0.85: land there",
    "own_scene": "meadow: 89 % of it is safe",
    "own_vehicle": "safe_slope_deg = 8.0, not 10.0; by MAVLink SLZ_SAFE_SLOPE",
}


@pytest.fixture(autouse=True)
def slz_is_on_the_path(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PATH", f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}")
    monkeypatch.setenv("PYTHONPATH", str(REPOSITORY))


@pytest.fixture
def run(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Callable[..., str]:
    """Run an example in this process, as `python NAME.py WORDS` in a folder; return what it prints."""

    def run_example(name: str, folder: Path, *words: str) -> str:
        monkeypatch.chdir(folder)
        monkeypatch.setattr(sys, "argv", [name, *words])
        runpy.run_path(str(EXAMPLES / f"{name}.py"), run_name="__main__")
        plt.close("all")
        return capsys.readouterr().out

    return run_example


def start(name: str, *words: str) -> subprocess.Popen[str]:
    return subprocess.Popen(
        [sys.executable, str(EXAMPLES / f"{name}.py"), *words], stdout=subprocess.PIPE, text=True
    )


@pytest.mark.parametrize("name", NAMES)
def test_an_example_is_one_screen_on_the_page_of_examples_with_its_picture(name: str) -> None:
    text, page = (EXAMPLES / f"{name}.py").read_text(), (REPOSITORY / "docs" / "examples.md").read_text()
    assert len(text.splitlines()) <= 40
    assert f'--8<-- "docs/examples/{name}.py"' in page
    picture = REPOSITORY / "docs" / "images" / f"example_{name}.png"
    assert picture.exists() == (f'"{name}.png"' in text) == (f"images/{picture.name}" in page)
    assert not picture.exists() or picture.stat().st_size < 60_000


@pytest.mark.parametrize("name", PLAIN)
def test_a_plain_example_prints_its_answer_and_draws_its_picture(
    name: str, run: Callable[..., str], tmp_path: Path
) -> None:
    assert PLAIN[name] in run(name, tmp_path)
    if f'"{name}.png"' in (EXAMPLES / f"{name}.py").read_text():
        assert (tmp_path / f"{name}.png").stat().st_size > 5_000


def test_a_laz_file_becomes_zones_and_these_points_of_a_map_in_metres(
    run: Callable[..., str], tmp_path: Path
) -> None:
    assert "zone 1: 3096 m2, slope 2.3 degrees" in run("map_laz", tmp_path)
    assert "1,2600041.6,1200024.8,3051" in run("zones_to_gis", tmp_path)
    assert (tmp_path / "landing_points.csv").read_text().startswith("zone,x_m,y_m,area_m2\n")


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_own(tmp_path_factory.mktemp("recording") / "flight.mcap", with_windows(recorded()))


def test_a_recording_is_read_by_topic(run: Callable[..., str], recording: Path, tmp_path: Path) -> None:
    said = run("read_recording", tmp_path, str(recording))
    assert "/raw/report: 4 messages" in said
    assert "4 windows; in the last, zones of 389 m2, certainty 0.90" in said


def test_a_recording_runs_again_with_other_limits(
    run: Callable[..., str], recording: Path, tmp_path: Path
) -> None:
    said = run("replay_with_other_limits", tmp_path, str(recording))
    assert "as flown: 4 of 4 reports equal those of the flight" in said
    assert "safe_slope_deg=3 relief_m=0.15: 0 of 4 reports equal those of the flight" in said


Until = Callable[[Callable[[], bool]], None]


@contextmanager
def vehicle(*urls: str, pilot_height_m: float | None) -> Iterator[tuple[Simulation, Companion, Until]]:
    """Fly a simulated vehicle with the companion on board, both on one simulated clock, until something."""
    port, lidar_port = free_port(), free_port()
    sim = Simulation.build(
        "plain",
        mavlink=[f"udpout:127.0.0.1:{port}", *urls],
        lidar_to=("127.0.0.1", lidar_port),
        pilot_height_m=pilot_height_m,
        tick_ns=10_000_000,
        lidar_ms=50,
        point_rate_hz=25_000,
    )
    loop = LockstepLoop(sim.advance)
    sources = Sources(f"livox:127.0.0.1:{lidar_port}")
    companion = Companion(f"udpin:127.0.0.1:{port}", sources, Parameters(zone_m=200.0), auto=False)
    task = loop.create_task(companion.run())

    async def wait(done: Callable[[], bool]) -> None:
        async with asyncio.timeout(600):  # of simulated time
            while not done():
                assert not task.done()
                await asyncio.sleep(0.05)

    try:
        yield sim, companion, lambda done: loop.run_until_complete(wait(done))
    finally:
        companion.stop()
        loop.run_until_complete(task)
        sim.close()
        loop.close()


def test_parameters_are_read_and_a_point_is_watched_in_flight() -> None:
    """Both examples are programs of their own, on links of their own to one flying vehicle."""
    urls = [f"tcpin:127.0.0.1:{free_port(socket.SOCK_STREAM)}" for _ in range(2)]
    with vehicle(*urls, pilot_height_m=15.0) as (sim, _, until):
        until(lambda: bool(sim.vehicle.truth.pos_enu_m[2] > 14.0))
        reader = start("read_parameters", urls[0].replace("tcpin", "tcp"))
        selector = start("select_point", urls[1].replace("tcpin", "tcp"))
        until(lambda: reader.poll() is not None and selector.poll() is not None)
    assert "SLZ_SAFE_SLOPE = 10\n" in reader.communicate()[0]
    assert selector.communicate()[0] == "MAV_RESULT_ACCEPTED\nthe point is safe\n"


async def test_a_landing_point_reaches_a_program_without_ros() -> None:
    async with node_and_listener() as (companion, node, _):
        assert companion.sensing.ros is not None
        listener = start("ros2_landing_point", companion.sensing.ros.url.endpoint)
        async with asyncio.timeout(60):
            while listener.poll() is None:  # it does not say when it has subscribed
                node.use_report(report_with())
                await asyncio.sleep(0.2)
    assert listener.communicate()[0].startswith("5.0 m east, 6.0 m north, 0.0 m up in frame 'map'\n")


def test_a_scene_of_ones_own_has_truth(tmp_path: Path) -> None:
    scene: Any = runpy.run_path(str(EXAMPLES / "own_scene.py"))["build"](1)
    assert scene.world.height_m(-30.0, 20.0) == pytest.approx(3.0, abs=1.0)  # the shed's roof
    assert np.isnan(scene.world.cast(np.array([[35.0, 0, 30]]), np.array([[0, 0, -1.0]]), 90.0)[0][0])  # pond


def test_a_method_of_ones_own_tells_a_wall_from_level_ground() -> None:
    method = method_of_file(EXAMPLES / "own_method.py")
    answer = method.judge(flight(lambda x, y: 1.0 * (np.abs(x) < 0.1)), SMALL)
    east = np.abs(SMALL.grid.centres()[0])
    assert (answer.state[(east > 1.2) & (east < 4)] == SAFE).all()
    assert (answer.state[east < 0.9] == UNSAFE).all()


def toy_packet(ms: int, points: list[tuple[int, int, int, int]]) -> bytes:
    timed = enumerate(points, start=1000 * (5000 + ms))
    return b"TOY1" + b"".join(struct.pack("<IiiiB", us, *point) for us, point in timed)


async def test_a_sensor_of_ones_own_is_received_and_decoded() -> None:
    toy: Any = runpy.run_path(str(EXAMPLES / "own_sensor.py"))["ToyDecoder"]
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    sensor_registry.add_sensor("toy", toy)
    try:
        with pytest.raises(ValueError, match="there already"):
            sensor_registry.add_sensor("toy", toy)
        batches: list[Returns] = []
        lidar = open_lidar(f"toy:127.0.0.1:{port}", Parameters(), batches.append)
        running = asyncio.ensure_future(lidar.run())
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
            sender.connect(("127.0.0.1", port))
            async with asyncio.timeout(30):
                while not batches:  # the port is bound a moment later, and the first packets may be refused
                    for number in (1, 2, 4):
                        with_a_hole = [(1000, 2000, 3000, 9), (0, 0, 0, 0), (-1, 0, 1, 255)]
                        try:
                            sender.send(toy_packet(number, with_a_hole))
                            sender.send(b"TOY1")
                        except ConnectionRefusedError:
                            break
                    await asyncio.sleep(0.02)
        running.cancel()
        np.testing.assert_allclose(batches[0].xyz_sensor_m[:2], [[1, -2, -3], [-0.001, 0, -0.001]], atol=1e-6)
        assert batches[0].stamp_ns[1] - batches[0].stamp_ns[0] == 2000
        assert batches[0].intensity[:2].tolist() == [9, 255]
        told = lidar.statistics()
        assert (told["packets"], told["returns"], told["no_return"]) == (3, 6, 3)
    finally:
        sensor_registry.remove_sensor("toy")


@pytest.mark.parametrize(
    ("kind", "port"), [("livox", None), ("Toy", None), ("a b", None), ("toy", 0), ("toy", 65536)]
)
def test_a_sensor_by_a_wrong_name_or_port_is_refused(kind: str, port: int | None) -> None:
    with pytest.raises(ValueError, match=f"sensor {kind!r}: |is there already"):
        sensor_registry.add_sensor(kind, lambda: pytest.fail("made"), port)


@pytest.mark.bench
@pytest.mark.timeout(600)
def test_the_demo_lands_on_safe_ground(run: Callable[..., str], tmp_path: Path) -> None:
    assert "landed: True, on truly safe ground: True" in run("land_in_simulation", tmp_path)


@pytest.mark.bench
@pytest.mark.timeout(400)
def test_a_landing_without_gps_ends_on_the_ground_by_the_autopilots_failsafe() -> None:
    said = start("fault_in_flight").communicate()[0]
    assert said == "failsafes of the autopilot: position lost\nlanded by slz: False, aborted landings: 0\n"


@pytest.mark.bench
@pytest.mark.timeout(400)
def test_a_mission_by_mavsdk_lands_where_slz_says() -> None:
    url = f"tcpin:127.0.0.1:{free_port(socket.SOCK_STREAM)}"
    with vehicle(url, pilot_height_m=None) as (sim, companion, until):
        mission = start("land_by_mission", url.replace("tcpin:", "tcpout://"))
        until(lambda: mission.poll() is not None)
        assert mission.communicate()[0].splitlines()[-1].startswith("landed ")
        assert companion.deciding.executive.tally.zone_id is not None
        assert companion.deciding.executive.phase is Phase.LANDED
        assert sim.touchdown is not None
        assert not fault_of(sim.scene.world, sim.touchdown)
