"""The examples of the documentation run."""

from __future__ import annotations

import asyncio
import json
import runpy
import socket
import struct
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from companion.desk.open_benchmark.landing_task import SAFE, UNSAFE
from companion.desk.open_benchmark.methods import method_of_file
from companion.flight.sensors import sensor_registry
from companion.flight.sensors.lidar_url import open_lidar
from companion.flight.sensors.returns import Returns
from params import Parameters
from tests import REPOSITORY
from tests.unit.companion.desk.open_benchmark.flights_over import SMALL, flight

EXAMPLES = REPOSITORY / "docs" / "examples"


def run(name: str, folder: Path, *words: str) -> str:
    done = subprocess.run(
        [sys.executable, str(EXAMPLES / name), *words],
        cwd=folder,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_a_las_file_becomes_zones_and_a_picture(tmp_path: Path) -> None:
    said = run("survey_a_file.py", tmp_path)
    assert "zone 1: 1930 m2" in said
    assert (tmp_path / "field.png").stat().st_size > 10_000


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


def toy_packet(number: int, points: list[tuple[int, int, int, int]]) -> bytes:
    head = struct.pack("<4sHHQI", b"TOY1", number, len(points), 5_000_000_000 + number * 1_000_000, 1000)
    return head + b"".join(struct.pack("<iiiB", *point) for point in points)


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
        assert (told["packets"], told["lost_packets"], told["malformed"]) == (3, 1, told["malformed"])
    finally:
        sensor_registry.remove_sensor("toy")


@pytest.mark.parametrize(
    ("kind", "port"), [("livox", None), ("Toy", None), ("a b", None), ("toy", 0), ("toy", 65536)]
)
def test_a_sensor_by_a_wrong_name_or_port_is_refused(kind: str, port: int | None) -> None:
    with pytest.raises(ValueError, match=f"sensor {kind!r}: |is there already"):
        sensor_registry.add_sensor(kind, lambda: pytest.fail("made"), port)


@pytest.mark.bench
@pytest.mark.timeout(400)
def test_a_mission_by_mavsdk_lands_where_slz_says(tmp_path: Path) -> None:
    said = run("own_mission.py", tmp_path)
    assert json.loads(said.splitlines()[-1])["ordered_zone"] > 0
