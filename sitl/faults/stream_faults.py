"""Faults of a LiDAR's stream: lost packets, pauses, sectors, rows, a dirty window, half the rate, clock."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from sitl.faults import packet_edit
from sitl.faults.fault import Fault
from sitl.faults.packet_edit import F64, I64, Flags
from sitl.sensors.lidar_port import UdpPort

if TYPE_CHECKING:
    from sitl.simulation import Simulation

Packets = list[bytes]

LOSS = 0.05, 0.4
SECTOR_DEG = 40.0, 80.0
DOWN_DEG = 0.0
"""Azimuth about which a covered or dirty sector is drawn, to `ASIDE_DEG`: there the sensor sees ground."""
ASIDE_DEG = 30.0
DIRT_M, DIRTY, DARK = (0.12, 0.25), 0.4, 0.7
PAUSE_NS, AWAKE_NS = 1_500_000_000, 2_000_000_000
STEP_S = 0.05, 0.7
DRIFT_PPM = 500.0, 2000.0
NOBODY = "127.0.0.1", 9
"""Where the packets of a sensor go that sends to another host."""


class Loss:
    """Random loss of a share of the packets."""

    def __init__(self, rng: np.random.Generator, share: float | None = None) -> None:
        self._rng = rng
        self._share = float(rng.uniform(*LOSS)) if share is None else share

    def __call__(self, packets: Packets) -> Packets:
        return [packet for packet in packets if self._rng.random() >= self._share]


class Sector:
    """Part of the circle that the sensor does not measure: no packets, or no valid columns, of it.

    A Livox sensor's points of it are zeros.
    """

    def __init__(
        self, rng: np.random.Generator, from_deg: float | None = None, width_deg: float = 0.0
    ) -> None:
        self._from_deg, self._width_deg = _drawn(rng) if from_deg is None else (from_deg, width_deg)

    def __call__(self, packets: Packets) -> Packets:
        kept = []
        for packet in packets:
            match packet_edit.maker_of(packet):
                case "livox":
                    kept.append(packet_edit.with_ranges(packet, self._is_inside, 0.0))
                case "velodyne" if not self._is_within(packet_edit.azimuth_deg(packet)):
                    kept.append(packet)
                case "ouster":
                    inside = self._is_within(packet_edit.azimuth_deg(packet))
                    kept.append(packet_edit.without_columns(packet) if inside else packet)
        return kept

    def _is_within(self, azimuth_deg: float) -> bool:
        return (azimuth_deg - self._from_deg) % 360 < self._width_deg

    def _is_inside(self, azimuth_deg: F64, line: I64) -> Flags:
        inside: Flags = (azimuth_deg - self._from_deg) % 360 < self._width_deg
        return inside


class Cover(Sector):
    """Cover before a part of the window: its rays return nothing."""

    def __call__(self, packets: Packets) -> Packets:
        return [packet_edit.with_ranges(packet, self._is_inside, 0.0) for packet in packets]


class Dirt:
    """Dirt on a part of the window: its rays return from the window itself, or often not at all."""

    def __init__(
        self, rng: np.random.Generator, from_deg: float | None = None, width_deg: float = 0.0
    ) -> None:
        self._rng = rng
        self._from_deg, self._width_deg = _drawn(rng) if from_deg is None else (from_deg, width_deg)

    def __call__(self, packets: Packets) -> Packets:
        return [self._soiled(packet) for packet in packets]

    def _soiled(self, packet: bytes) -> bytes:
        dark = packet_edit.with_ranges(packet, self._part(DARK), 0.0)
        return packet_edit.with_ranges(dark, self._part(DIRTY), float(self._rng.uniform(*DIRT_M)))

    def _part(self, share: float) -> packet_edit.Rays:
        def which(azimuth_deg: F64, line: I64) -> Flags:
            inside: Flags = (azimuth_deg - self._from_deg) % 360 < self._width_deg
            chosen: Flags = inside & (self._rng.random(len(azimuth_deg)) < share)
            return chosen

        return which


class DeadRow:
    """Laser line that returns nothing."""

    def __init__(self, line: int) -> None:
        self._line = line

    def __call__(self, packets: Packets) -> Packets:
        return [packet_edit.with_ranges(packet, self._is_dead, 0.0) for packet in packets]

    def _is_dead(self, azimuth_deg: F64, line: I64) -> Flags:
        dead: Flags = line == self._line
        return dead


class HalfRate:
    """Sensor that measures half of the time: every second packet is not made, and none is missing."""

    def __init__(self) -> None:
        self._seen = 0
        self._first: int | None = None

    def __call__(self, packets: Packets) -> Packets:
        kept = []
        for packet in packets:
            if self._first is None:
                self._first = packet_edit.number_of(packet)
            if self._seen % 2 == 0:
                kept.append(packet_edit.numbered(packet, self._first + self._seen // 2))
            self._seen += 1
        return kept


class ShiftedClock:
    """Stamps of a clock that was set once, and from then on runs fast or slow."""

    def __init__(self, step_s: float, ppm: float = 0.0) -> None:
        self._step_ns, self._ppm = round(step_s * 1e9), ppm
        self._begun_ns: int | None = None

    def __call__(self, packets: Packets) -> Packets:
        return [packet_edit.restamped(packet, self._later) for packet in packets]

    def _later(self, stamp_ns: int) -> int:
        if self._begun_ns is None:
            self._begun_ns = stamp_ns
        return stamp_ns + self._step_ns + round((stamp_ns - self._begun_ns) * self._ppm * 1e-6)


def stepped(rng: np.random.Generator) -> ShiftedClock:
    """Return a clock that is set by 50 to 700 ms, forward or back."""
    return ShiftedClock(float(rng.uniform(*STEP_S)) * (1 if rng.random() < 0.5 else -1))


def drifting(rng: np.random.Generator) -> ShiftedClock:
    """Return a clock that runs fast or slow by 500 to 2,000 millionths."""
    return ShiftedClock(0.0, float(rng.uniform(*DRIFT_PPM)) * (1 if rng.random() < 0.5 else -1))


class Pauses(Fault):
    """Sensor that falls silent for 1.5 s, again and again, 2 s after it came back."""

    def __init__(self) -> None:
        self._begun_ns = 0

    def start(self, simulation: Simulation) -> None:
        self._begun_ns = simulation.now_ns

    def on_tick(self, simulation: Simulation) -> None:
        past_ns = (simulation.now_ns - self._begun_ns) % (PAUSE_NS + AWAKE_NS)
        simulation.lidar_on = past_ns >= PAUSE_NS

    def stop(self, simulation: Simulation) -> None:
        simulation.lidar_on = True


class Elsewhere(Fault):
    """Sensor whose packets go to another host.

    Raises
    ------
    ValueError
        On `start`, if the simulation has no LiDAR that sends packets.
    """

    def __init__(self) -> None:
        self._address: tuple[str, int] | None = None

    def start(self, simulation: Simulation) -> None:
        port = simulation.lidar
        if not isinstance(port, UdpPort):
            raise ValueError("LiDAR fault: this simulation has no LiDAR that sends packets; give it lidar_to")
        self._address, port.address = port.address, NOBODY

    def stop(self, simulation: Simulation) -> None:
        if self._address is not None and isinstance(simulation.lidar, UdpPort):
            simulation.lidar.address = self._address


def _drawn(rng: np.random.Generator) -> tuple[float, float]:
    """Return start and width of a sector where the sensor sees ground, degrees."""
    width = float(rng.uniform(*SECTOR_DEG))
    return DOWN_DEG + float(rng.uniform(-ASIDE_DEG, ASIDE_DEG)) - width / 2, width
