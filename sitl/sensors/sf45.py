"""LightWare SF45/B: one beam that swings to and fro, and its serial protocol.

Implements the SF45/B product guide and LightWare's description of its binary protocol. It sends the first
return; the beam is 0.5 degrees wide, the maker's figure, from a lens of 20 mm, an estimate.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from sitl.sensors.lidar_mount import Mount
from sitl.world.wires import Beam
from sitl.world.world import World

F64 = NDArray[np.float64]
I64 = NDArray[np.int64]
RATES_HZ = dict(enumerate((50, 100, 200, 400, 500, 625, 1000, 1250, 1538, 2000, 2500, 5000), start=1))
MOST_PAYLOAD = 16  # of a command
MOST_RANGE_M, LEAST_RANGE_M = 50.0, 0.2
BEAM = Beam((0.02, 0.02), (float(np.radians(0.5)), float(np.radians(0.5))))
WHITE = 0.8
"""Brightness that returns from the greatest range; the least for a range falls with its square."""
_OUTPUT, _STREAM, _DISTANCES, _RATE, _SCAN = 27, 30, 44, 66, 96


def crc16(data: bytes) -> int:
    """Return CRC-16/XMODEM."""
    value = 0
    for byte in data:
        value ^= byte << 8
        for _ in range(8):
            value = (value << 1 ^ 0x1021 if value & 0x8000 else value << 1) & 0xFFFF
    return value


def frame(command: int, data: bytes, write: bool = False) -> bytes:
    """Return a frame of the protocol."""
    payload = bytes([command]) + data
    head = struct.pack("<BH", 0xAA, (len(payload) << 6) | int(write))
    return head + payload + struct.pack("<H", crc16(head + payload))


@dataclass(slots=True)
class Sf45:
    """SF45/B sensor, configured over its serial line, which sends the ranges of its beam.

    mount: x along the beam at angle 0, z along the axis of the swing. half_angle_deg: half the angle of the
    swing. sweep_hz: complete swings per second.
    """

    rng: np.random.Generator
    mount: Mount = field(default_factory=lambda: Mount(pitch_deg=90.0))
    half_angle_deg: float = 45.0
    sweep_hz: float = 5.0
    noise_m: float = 0.02
    rate: int = 5
    fields: int = 1
    streaming: bool = False
    scanning: bool = True
    _waiting: bytearray = field(default_factory=bytearray)

    def receive(self, data: bytes) -> bytes:
        """Process bytes from the line and return the answers."""
        self._waiting += data
        answers = b""
        while len(self._waiting) >= 3:
            length = (self._waiting[1] | self._waiting[2] << 8) >> 6
            if self._waiting[0] != 0xAA or not 0 < length <= MOST_PAYLOAD:
                del self._waiting[0]
                continue
            whole = length + 5
            if len(self._waiting) < whole:
                break
            head, sent = (
                bytes(self._waiting[: whole - 2]),
                struct.unpack_from("<H", self._waiting, whole - 2)[0],
            )
            if length == 0 or crc16(head) != sent:
                del self._waiting[0]
                continue
            del self._waiting[:whole]
            answers += self._command(head[3], head[4:])
        return answers

    def _command(self, command: int, data: bytes) -> bytes:
        if command == _RATE and len(data) == 1 and data[0] in RATES_HZ:
            self.rate = data[0]
        elif command == _OUTPUT and len(data) == 4:
            self.fields = struct.unpack("<I", data)[0]
        elif command == _SCAN and len(data) == 1:
            self.scanning = bool(data[0])
        elif command == _STREAM and len(data) == 4:
            self.streaming = struct.unpack("<I", data)[0] == 5
        else:
            return b""
        return frame(command, data, write=True)

    def angles_deg(self, time_s: F64) -> F64:
        """Return the beam's angle, clockwise from ahead: a triangle wave."""
        if not self.scanning:
            return np.zeros_like(time_s)
        turn = (time_s * self.sweep_hz) % 1.0
        swing: F64 = self.half_angle_deg * (4 * np.abs(turn - 0.5) - 1)
        return swing

    def scan(self, t0_ns: int, t1_ns: int, pose_at: object, world: World) -> bytes:
        """Fire the pulses due in [t0_ns, t1_ns) and return their frames, none while not streaming."""
        period = 1_000_000_000 // RATES_HZ[self.rate]
        first, last = -(-t0_ns // period), -(-t1_ns // period)
        times: I64 = np.arange(first, last, dtype=np.int64) * period
        if not self.streaming or not len(times):
            return b""
        position, attitude = pose_at(times)  # type: ignore[operator]
        angle = self.angles_deg(np.asarray(times * 1e-9))
        radians = np.radians(angle)
        beam = np.column_stack([np.cos(radians), -np.sin(radians), np.zeros_like(radians)])
        origin = position + self.mount.lever_enu_m(attitude)
        true_m = self._first_m(world, origin, self.mount.to_enu(beam, attitude), attitude)
        measured = true_m + self.noise_m * self.rng.standard_normal(len(times))
        seen = np.isfinite(true_m) & (true_m >= LEAST_RANGE_M) & (true_m <= MOST_RANGE_M)
        out = b""
        for k in range(len(times)):
            cm = round(float(measured[k]) * 100) if seen[k] else -100
            fields = struct.pack("<h", cm)
            if self.fields & 1 << 8:
                fields += struct.pack("<h", round(float(angle[k]) * 100))
            out += frame(_DISTANCES, fields)
        return out

    def _first_m(self, world: World, origin: F64, direction: F64, attitude: F64) -> F64:
        """Return the range of the first echo of each beam, NaN for none."""
        opaque_m, _, _ = world.trace(origin, direction, MOST_RANGE_M, thin_wires=False)
        if not world.wires:
            return opaque_m
        up = self.mount.to_enu(np.tile([0.0, 0.0, 1.0], (len(attitude), 1)), attitude)
        wires = world.wires.echoes(origin, direction, up, opaque_m, MOST_RANGE_M, BEAM)
        seen = wires.bright >= WHITE * (np.nan_to_num(wires.range_m, nan=np.inf) / MOST_RANGE_M) ** 2
        first_m = np.where(seen, wires.range_m, np.inf).min(axis=1)
        return np.where(np.isfinite(first_m), first_m, opaque_m)
