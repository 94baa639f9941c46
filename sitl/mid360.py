"""Livox Mid-360: pulses fired one by one at the moving world, returned as the sensor's own packets.

Numbers from the data sheet: 200 000 pulses/s, field of view 360 x (-7..52) deg, range 40 m at 10 % and
70 m at 80 % reflectivity, blind below 0.1 m, range precision 2 cm (3 cm very near) and angular
precision 0.15 deg, both 1 sigma, false alarms below 0.01 %.

Counters: the protocol document lets ``udp_cnt`` restart with each frame; recordings of real sensors
show a free-running ``udp_cnt`` and a ``frame_cnt`` that stays 0. Real behaviour is the default,
``frame_restart=True`` gives the documented one.

Not modelled: the size of the beam (mixed pixels at edges), the vehicle's own legs in the view.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from sitl.livox_packets import POINTS_PER_PACKET, DataType, Label, encode_points
from sitl.mid360_pattern import directions
from sitl.mount import Mount
from sitl.primitives import REFLECTANCE
from sitl.world import World

F64 = NDArray[np.float64]
I64 = NDArray[np.int64]
U8 = NDArray[np.uint8]

PoseAt = Callable[[I64], tuple[F64, F64]]
"""Stamps (n,) ns of simulated time -> position ENU (n, 3) m, quaternion wxyz (n, 4) body FRD -> NED."""

MAX_RANGE_M = 80.0
BLIND_RANGE_M = 0.1
FRAME_NS = 100_000_000
_RANGE_AT_10_PERCENT_M = 40.0
_RANGE_EXPONENT = np.log(70.0 / 40.0) / np.log(0.8 / 0.1)
# Tag bits 2-3 are confidence against rain, fog and dust, bits 4-5 other causes; 1 medium, 2 low.
_TAG_DUST, _TAG_GHOST = np.uint8(1 << 2), np.uint8(1 << 4)


@dataclass(frozen=True, slots=True)
class Noise:
    """What keeps a real sensor from being exact; probabilities are per pulse."""

    range_sigma_m: float = 0.02
    angle_sigma_deg: float = 0.15
    dropout: float = 0.005
    ghost: float = 1e-4
    dust: float = 1e-4
    tagged: float = 0.7
    """Share of ghosts and dust that the sensor marks in the tag."""

    @classmethod
    def none(cls) -> Noise:
        """Return a perfect sensor (limits of range and of reflectivity stay)."""
        return cls(0.0, 0.0, 0.0, 0.0, 0.0)


@dataclass(frozen=True, slots=True)
class Clock:
    """The sensor's own clock: ``offset_ns`` at simulated time 0, fast by ``drift_ppb``."""

    offset_ns: int = 7_300_000_000
    drift_ppb: int = 12_000

    def sensor_ns(self, time_ns: int) -> int:
        return self.offset_ns + time_ns + time_ns * self.drift_ppb // 1_000_000_000

    def simulated_ns(self, elapsed_ns: I64) -> I64:
        """Return simulated times at which this clock has advanced by elapsed_ns (rounded up)."""
        return elapsed_ns - elapsed_ns * self.drift_ppb // (1_000_000_000 + self.drift_ppb)


@dataclass(slots=True)
class _Pending:
    """Points that wait for their packet to fill."""

    points_m: F64 = field(default_factory=lambda: np.empty((0, 3)))
    reflectivity: U8 = field(default_factory=lambda: np.empty(0, np.uint8))
    tag: U8 = field(default_factory=lambda: np.empty(0, np.uint8))
    first: int = 0


class Mid360:
    """A Mid-360 on a moving vehicle.

    Parameters
    ----------
    rng
        Source of all noise. The output does not depend on how time is cut into steps.
    mount
        Where and how the sensor is fixed; see ``Mount`` for the sensor frame.
    point_rate_hz
        Pulses per second; must divide 10^9. Packets hold 96 points, or fewer at a rate so low that
        the time within a packet would not fit its field (below about 14 500 / s).
    data_type
        Point format on the wire.
    clock
        The sensor's free-running clock (``time_type`` 0).
    noise
        Error model.
    frame_restart
        True: counters as in the protocol document. False: as in real recordings.

    Raises
    ------
    ValueError
        If the rate does not divide 10^9.
    """

    def __init__(
        self,
        rng: np.random.Generator,
        mount: Mount | None = None,
        *,
        point_rate_hz: int = 200_000,
        data_type: DataType = DataType.CARTESIAN_32,
        clock: Clock | None = None,
        noise: Noise | None = None,
        frame_restart: bool = False,
    ) -> None:
        if point_rate_hz <= 0 or 1_000_000_000 % point_rate_hz:
            raise ValueError(f"mid360: point_rate_hz {point_rate_hz} does not divide 1 000 000 000")
        self.mount = mount or Mount()
        self.data_type = data_type
        self.clock = clock or Clock()
        self.noise = noise or Noise()
        self.period_ns = 1_000_000_000 // point_rate_hz
        self.points_per_packet = min(POINTS_PER_PACKET, 6_553_500 // self.period_ns + 1)
        self._frame_restart = frame_restart
        # One stream a distribution: a stream is then read in the same order however time is cut.
        self._normal, self._uniform = rng.spawn(2)
        self._next_point = 0
        self._pending = _Pending()
        self._until_ns: int | None = None
        self._udp_count = 0
        self._frame = -1

    def step(self, t0_ns: int, t1_ns: int, pose_at: PoseAt, world: World) -> list[bytes]:
        """Fire every pulse due in [t0_ns, t1_ns) and return the packets that became full.

        Points that do not fill a packet wait for the next step. A gap between steps is a sensor
        switched off and on: what waited is lost.

        Parameters
        ----------
        t0_ns, t1_ns
            Simulated time.
        pose_at
            Pose of the vehicle at given times, each within [t0_ns, t1_ns).
        world
            What the pulses meet.
        """
        if self._until_ns != t0_ns:
            self._next_point = self._points_before(t0_ns)
            self._pending = _Pending(first=self._next_point)
        self._until_ns = t1_ns
        end = self._points_before(t1_ns)
        index = np.arange(self._next_point, end, dtype=np.int64)
        self._next_point = max(end, self._next_point)
        if index.size:
            points, reflectivity, tag = self._fire(index, pose_at, world)
            waiting = self._pending
            waiting.points_m = np.concatenate([waiting.points_m, points])
            waiting.reflectivity = np.concatenate([waiting.reflectivity, reflectivity])
            waiting.tag = np.concatenate([waiting.tag, tag])
        return self._full_packets()

    def look(self, t0_ns: int, t1_ns: int, pose_at: PoseAt, world: World) -> tuple[F64, U8, I64]:
        """Fire every pulse due in [t0_ns, t1_ns); return points (n, 3) in the sensor frame, tags and times.

        What `step` sends, before it is put into packets; a point at the origin is no return.
        """
        index = np.arange(self._points_before(t0_ns), self._points_before(t1_ns), dtype=np.int64)
        points, _, tag = self._fire(index, pose_at, world)
        return points, tag, self.clock.simulated_ns(index * self.period_ns)

    def _points_before(self, time_ns: int) -> int:
        """Return how many pulses are fired before a simulated time (pulse k at elapsed k * period)."""
        elapsed = time_ns + time_ns * self.clock.drift_ppb // 1_000_000_000
        count = elapsed // self.period_ns + 2
        while count > 0 and self._fired_ns(count - 1) >= time_ns:
            count -= 1
        return count

    def _fired_ns(self, point: int) -> int:
        return int(self.clock.simulated_ns(np.array([point * self.period_ns], dtype=np.int64))[0])

    def _fire(self, index: I64, pose_at: PoseAt, world: World) -> tuple[F64, U8, U8]:
        elapsed_ns = index * self.period_ns
        nominal = directions(index, elapsed_ns)
        position, attitude = pose_at(self.clock.simulated_ns(elapsed_ns))
        normal = self._normal.standard_normal((index.size, 4))
        uniform = self._uniform.random((index.size, 4))
        fired = _tilt(nominal, normal[:, :2], self.noise.angle_sigma_deg)
        origin = position + self.mount.lever_enu_m(attitude)
        true_range, kind, cosine = world.trace(origin, self.mount.to_enu(fired, attitude), MAX_RANGE_M)
        bright = REFLECTANCE[kind] * cosine
        seen = self._detected(true_range, bright, normal[:, 3], uniform[:, 0])
        measured = np.where(seen, true_range + self._range_error(true_range, normal[:, 2]), 0.0)
        measured, tag = self._false_returns(measured, seen, uniform)
        reflectivity = np.clip(np.rint(150.0 * bright), 1, 150).astype(np.uint8)
        reflectivity[tag != 0] = 3
        reflectivity[measured == 0.0] = 0
        return nominal * measured[:, np.newaxis], reflectivity, tag

    def _range_error(self, range_m: F64, normal: F64) -> F64:
        """Range noise: the data sheet's 2 cm at 10 m, half as much again at 0.2 m."""
        sigma = self.noise.range_sigma_m * (1.0 + 0.5 * np.exp(-np.nan_to_num(range_m) / 2.0))
        return sigma * normal

    def _detected(self, range_m: F64, bright: F64, normal: F64, uniform: F64) -> NDArray[np.bool_]:
        """Say which pulses come back bright enough: 40 m at 10 %, 70 m at 80 %, with a soft edge."""
        limit = _RANGE_AT_10_PERCENT_M * (np.maximum(bright, 1e-6) / 0.1) ** _RANGE_EXPONENT
        limit *= 1.0 + 0.04 * np.clip(normal, -3.0, 3.0)
        in_range = (range_m >= BLIND_RANGE_M) & (range_m <= limit)
        detected: NDArray[np.bool_] = in_range & (uniform >= self.noise.dropout)
        return detected

    def _false_returns(self, measured: F64, seen: NDArray[np.bool_], uniform: F64) -> tuple[F64, U8]:
        """Add multi-path ghosts (too far) and dust or rain (a few metres ahead, too near)."""
        tag = np.zeros(measured.size, np.uint8)
        marked = uniform[:, 2] < self.noise.tagged
        ghost = seen & (uniform[:, 1] < self.noise.ghost)
        measured = np.where(ghost, measured * (1.05 + 0.6 * uniform[:, 3]), measured)
        tag[ghost & marked] = _TAG_GHOST
        dust = uniform[:, 1] > 1.0 - self.noise.dust
        nearer = 0.3 + 8.0 * uniform[:, 3] ** 2
        dust &= ~seen | (nearer < measured)
        measured = np.where(dust, nearer, measured)
        tag[dust & marked] = _TAG_DUST
        return measured, tag

    def _full_packets(self) -> list[bytes]:
        size, waiting = self.points_per_packet, self._pending
        count = len(waiting.tag) // size
        packets = []
        for k in range(count):
            cut = slice(k * size, (k + 1) * size)
            label = self._label(waiting.first + k * size)
            packets.append(
                encode_points(
                    label, waiting.points_m[cut], waiting.reflectivity[cut], waiting.tag[cut], self.data_type
                )
            )
        done = count * size
        self._pending = _Pending(
            waiting.points_m[done:], waiting.reflectivity[done:], waiting.tag[done:], waiting.first + done
        )
        return packets

    def _label(self, first_point: int) -> Label:
        elapsed = first_point * self.period_ns
        if self._frame_restart and elapsed // FRAME_NS != self._frame:
            self._frame = elapsed // FRAME_NS
            self._udp_count = 0
        label = Label(
            stamp_ns=self.clock.offset_ns + elapsed,
            interval_ns=(self.points_per_packet - 1) * self.period_ns,
            udp_count=self._udp_count,
            frame_count=self._frame if self._frame_restart else 0,
        )
        self._udp_count += 1
        return label


def _tilt(unit: F64, normal: F64, sigma_deg: float) -> F64:
    """Tilt unit vectors at random; sigma is that of the whole angle, shared by two axes."""
    if sigma_deg == 0.0:
        return unit
    z = np.array([0.0, 0.0, 1.0])
    across = np.cross(z, unit)
    across /= np.linalg.norm(across, axis=1, keepdims=True)
    up = np.cross(unit, across)
    scale = np.radians(sigma_deg) / np.sqrt(2.0)
    tilted = unit + scale * (normal[:, :1] * across + normal[:, 1:] * up)
    out: F64 = tilted / np.linalg.norm(tilted, axis=1, keepdims=True)
    return out
