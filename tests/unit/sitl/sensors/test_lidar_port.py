"""Simulated LiDAR behind its socket or serial line, seen from the other end."""

from __future__ import annotations

import os
import socket
import struct
import tty
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from companion.flight.sensors.decoders.lightware_protocol import LightwareDecoder, requests
from companion.flight.sensors.decoders.livox_decoder import LivoxDecoder
from sitl import scenes
from sitl.sensors import lidars
from sitl.sensors.lidar_mount import Mount
from sitl.sensors.lidar_port import PTY
from sitl.sensors.opal import HALF_CONE_DEG, Opal
from sitl.sensors.optics import Noise
from sitl.sensors.sf45 import Sf45
from sitl.wire.wire import WireError
from sitl.world.primitives import Wire
from sitl.world.world import World
from tests.unit.sitl.still_world import flat_world, hover

MS = 1_000_000
WORLD = scenes.build("plain", 1).world
UP_M = 150.0


def hovering(stamps_ns: NDArray[np.int64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    n = len(stamps_ns)
    return np.tile([0.0, 0.0, UP_M], (n, 1)), np.tile([1.0, 0.0, 0.0, 0.0], (n, 1))


def hovering_low(stamps_ns: NDArray[np.int64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    place, attitude = hovering(stamps_ns)
    return place * [1, 1, 20 / UP_M], attitude


def test_a_scanner_on_a_pseudo_terminal_answers_and_streams_the_ground_below() -> None:
    port = lidars.open_port("sf45", np.random.default_rng(1), 0, PTY)
    line = os.open(port.name, os.O_RDWR | os.O_NOCTTY)
    tty.setraw(line)
    os.set_blocking(line, False)
    decoder, points = LightwareDecoder(), []
    port.scan(0, 20 * MS, hovering_low, WORLD)
    with pytest.raises(BlockingIOError):
        os.read(line, 4096)
    for request in requests():
        os.write(line, request)
    for k in range(1, 50):
        port.scan(k * 20 * MS, (k + 1) * 20 * MS, hovering_low, WORLD)
        points.append(decoder.feed(os.read(line, 65536))[0])
    os.close(line)
    port.close()
    ahead_m = np.concatenate(points)[:, 0]
    assert len(ahead_m) > 450
    ground_m = float(WORLD.height_m(0.0, 0.0))
    np.testing.assert_allclose(ahead_m, 20.0 - 0.05 - ground_m, atol=0.3)


def test_what_is_no_serial_device_is_refused(tmp_path: Path) -> None:
    for device, words in (("/dev/null", "not a serial device"), (str(tmp_path / "none"), "No such file")):
        with pytest.raises(WireError, match=words):
            lidars.open_port("sf45", np.random.default_rng(1), 0, device)


@pytest.mark.parametrize(("name", "to"), [("sf45", ("127.0.0.1", 9)), ("mid360", "/dev/ttyS0")])
def test_a_sensor_goes_with_its_own_kind_of_line(name: str, to: object) -> None:
    with pytest.raises(ValueError, match=f"LiDAR {name} sends to"):
        lidars.open_port(name, np.random.default_rng(1), 200_000, to)  # type: ignore[arg-type]


def test_the_paper_s_scanner_fills_its_cone_and_comes_out_of_the_livox_driver() -> None:
    opal = Opal(np.random.default_rng(1), noise=Noise.none())
    packets = opal.scan(0, 500 * MS, hovering_low, WORLD)
    decoder = LivoxDecoder()
    for packet in packets:
        assert decoder.check(packet) is not None
        decoder.add_packet(packet)
    raw = decoder.drain()
    unit = raw.xyz_m / np.linalg.norm(raw.xyz_m, axis=1, keepdims=True)
    angle_deg = np.degrees(np.arccos(np.clip(unit[:, 0], -1, 1)))
    assert len(raw) > 95_000
    assert angle_deg.max() == pytest.approx(HALF_CONE_DEG, abs=0.1)
    # Every part of the cone is met within half a second.
    rings = np.histogram(angle_deg, np.arange(0, HALF_CONE_DEG + 1, 5))[0]
    assert (rings > 2000).all()
    assert raw.xyz_m[:, 0].max() == pytest.approx(20.0, abs=2)


def test_packets_for_nobody_cost_nothing() -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as gone:
        gone.bind(("127.0.0.1", 0))
        address = gone.getsockname()
    port = lidars.open_port("mid360", np.random.default_rng(1), 10_000, address)
    for k in range(5):
        port.scan(k * 20 * MS, (k + 1) * 20 * MS, hovering_low, WORLD)
    port.close()


# Simulated SF45: the first of the echoes of wire and ground.


DOWN = Mount(lever_frd_m=(0.0, 0.0, 0.0), pitch_deg=90.0)


@pytest.mark.parametrize(
    ("below_m", "thick_m", "range_m"), [(10.0, 0.020, 10.0), (10.0, 0.005, 45.0), (5.0, 0.005, 5.0)]
)
def test_a_wire_bright_enough_for_its_range_is_the_first_return(
    below_m: float, thick_m: float, range_m: float
) -> None:
    """The threshold at 10 m is a brightness of 0.032: 20 mm return 0.062, 5 mm 0.016; at 5 m it is 0.008."""
    wire = Wire((-9.0, 0.0, 45.0 - below_m), (9.0, 0.0, 45.0 - below_m), thick_m / 2)
    lidar = Sf45(np.random.default_rng(1), mount=DOWN, noise_m=0.0, scanning=False, streaming=True)
    frames = lidar.scan(0, 10_000_000, hover(z=45.0), World(flat_world().ground, [wire]))
    (distance,) = struct.unpack("<h", frames[4:6])
    assert distance / 100 == pytest.approx(range_m, abs=0.02)
