"""Base class of LiDARs that fire single pulses into a moving world.

A beam has a width in plants and snow, see ``layer_echoes``, at thin wires, see ``wire_cast``, and at edges,
see ``beam_edges``. Not modelled: noise that neighbouring pulses share, the vehicle's own legs in the view.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

from sitl.sensors.layer_echoes import (
    PARTS,
    BeamEchoes,
    beam_echoes,
    echo_hits,
    merge,
    touched,
    with_wires,
)
from sitl.sensors.lidar_mount import Mount
from sitl.sensors.optics import (
    Echoes,
    Flags,
    Hits,
    Noise,
    Reach,
    tilt,
)
from sitl.sensors.pulse_returns import measure, report_several, report_single
from sitl.sensors.sensor_clock import Clock
from sitl.world.beam_edges import edge_echoes
from sitl.world.hits import NOTHING
from sitl.world.primitives import REFLECTANCE
from sitl.world.wires import Beam, WireEchoes
from sitl.world.world import Crossings, World

F64 = NDArray[np.float64]
I64 = NDArray[np.int64]
OF_ECHOES = tuple(field.name for field in fields(Echoes))

PoseAt = Callable[[I64], tuple[F64, F64]]
"""Stamps (n,) ns of simulated time -> position ENU (n, 3) m, quaternion wxyz (n, 4) body FRD -> NED."""


@dataclass(frozen=True, slots=True)
class Shots:
    """Pulses and their measurements; arrays of one length.

    index: number of the pulse. unit: (n, 3) nominal direction in the sensor frame. echoes: see `Echoes`.
    bright: reflectance times the cosine of incidence at the hit. hits: what the returns come from, which no
    real sensor knows.
    """

    index: I64
    unit: F64
    echoes: Echoes
    bright: F64
    hits: Hits

    def __len__(self) -> int:
        return len(self.index)

    def __getitem__(self, cut: slice) -> Shots:
        echoes = Echoes(*(getattr(self.echoes, name)[cut] for name in OF_ECHOES))
        return Shots(self.index[cut], self.unit[cut], echoes, self.bright[cut], self.hits[cut])

    def followed_by(self, later: Shots) -> Shots:
        """Return these shots followed by later ones."""
        pairs = ((getattr(self.echoes, name), getattr(later.echoes, name)) for name in OF_ECHOES)
        return Shots(
            np.concatenate([self.index, later.index]),
            np.concatenate([self.unit, later.unit]),
            Echoes(*(np.concatenate(pair) for pair in pairs)),
            np.concatenate([self.bright, later.bright]),
            self.hits.followed_by(later.hits),
        )


@dataclass(frozen=True, slots=True)
class Rays:
    """Traced pulses: their places among all, (m,); (m, 3) origins, unit directions and sensor's up, ENU."""

    at: I64
    origin: F64
    direction: F64
    up: F64


@dataclass(frozen=True, slots=True)
class Several:
    """Pulses with several possible echoes: their places, echoes and codes of ``hits``.

    by_power: mask of those whose strongest echo is the one of most power at the receiver, where these may be
    far apart: a wire or an edge is among them.
    """

    at: I64
    echoes: BeamEchoes
    labels: I64
    by_power: Flags


class PulseLidar(ABC):
    """LiDAR on a moving vehicle.

    A subclass defines the time and direction of the n-th pulse, and the encoding of a packet.

    Parameters
    ----------
    rng
        Source of all noise. The output does not depend on how time is divided into steps.
    mount
        Position and orientation of the sensor; see ``Mount`` for the sensor frame.
    clock
        The sensor's free-running clock.
    noise
        Error model.
    reach
        Range limits.
    pulses_per_packet
        Number of pulses in a packet.

    Attributes
    ----------
    WAVELENGTH_NM
        Of the laser; see ``water_optics``.
    SEPARATION_M
        Least distance of two returns of one pulse.
    beam
        Width of a beam.
    """

    WAVELENGTH_NM = 905
    SEPARATION_M = 1.0
    beam: Beam

    def __init__(
        self,
        rng: np.random.Generator,
        mount: Mount,
        clock: Clock | None,
        noise: Noise,
        reach: Reach,
        pulses_per_packet: int,
    ) -> None:
        self.mount = mount
        self.clock = clock or Clock()
        self.noise = noise
        self.reach = reach
        self.pulses_per_packet = pulses_per_packet
        # One stream per distribution, so that it is read in the same order however time is divided.
        self._normal, self._uniform = rng.spawn(2)
        self._leaf, self._glint = rng.spawn(2)
        self._air_seed = int(rng.spawn(1)[0].integers(1 << 32))
        self._flicker, rows = rng.spawn(2)
        self._row_m = noise.row_sigma_m * rows.standard_normal(self.rows)
        self._next = 0
        self._pending: Shots | None = None
        self._until_ns: int | None = None

    # ---- interface of a kind of sensor ----------------------------------------------------------

    @abstractmethod
    def fired_ns(self, index: I64) -> I64:
        """Return firing times of pulses, sensor clock since power-up; they rise with the index."""

    @abstractmethod
    def pulses_about(self, elapsed_ns: int) -> tuple[int, int]:
        """Return two pulse numbers, certainly fired and certainly not yet fired, at an elapsed time."""

    @abstractmethod
    def directions(self, index: I64) -> F64:
        """Return nominal unit vectors (n, 3) of pulses in the sensor frame."""

    @abstractmethod
    def encode(self, shots: Shots) -> list[bytes]:
        """Return the packets that are sent of these pulses, which fill them."""

    @property
    def group(self) -> int:
        """Number of pulses that a packet never separates; a packet begins with the first of a group."""
        return 1

    @property
    def rows(self) -> int:
        """Number of lasers, which fire in turn."""
        return 1

    def origins_m(self, index: I64) -> F64 | None:
        """Return the origins of pulses, (n, 3) in the sensor frame; None if all start at its origin."""
        return None

    def is_traced(self, index: I64) -> NDArray[np.bool_] | None:
        """Return the mask of pulses traced into the world, the others get no return; None for all."""
        return None

    # ---- use ------------------------------------------------------------------------------------

    def scan(self, t0_ns: int, t1_ns: int, pose_at: PoseAt, world: World) -> list[bytes]:
        """Fire every pulse due in [t0_ns, t1_ns) and return the full packets.

        Points that do not fill a packet wait for the next scan. A gap between scans means that the sensor was
        switched off and on: waiting points are lost.

        Parameters
        ----------
        t0_ns, t1_ns
            Simulated time.
        pose_at
            Pose of the vehicle at given times, each within [t0_ns, t1_ns).
        world
            World that the pulses meet.
        """
        if self._until_ns != t0_ns:
            # A packet holds only whole groups of pulses, wherever the sensor was switched on.
            group = self.group
            self._next = -(-self._pulses_before(t0_ns) // group) * group
            self._pending = None
        self._until_ns = t1_ns
        end = self._pulses_before(t1_ns)
        index = np.arange(self._next, end, dtype=np.int64)
        self._next = max(end, self._next)
        if index.size:
            shots = self.fire(index, pose_at, world)
            self._pending = shots if self._pending is None else self._pending.followed_by(shots)
        return self._full_packets()

    def shots(self, t0_ns: int, t1_ns: int, pose_at: PoseAt, world: World) -> Shots:
        """Fire every pulse due in [t0_ns, t1_ns) and return the shots without packets."""
        index = np.arange(self._pulses_before(t0_ns), self._pulses_before(t1_ns), dtype=np.int64)
        return self.fire(index, pose_at, world)

    def points_m(self, shots: Shots) -> F64:
        """Return the measured points, (n, 3) in the sensor frame; meaningless without a return."""
        points: F64 = shots.unit * shots.echoes.range_m[:, np.newaxis]
        origins = self.origins_m(shots.index)
        return points if origins is None else points + origins

    def stamps_ns(self, shots: Shots) -> I64:
        """Return the simulated times of pulses."""
        return self.clock.simulated_ns(self.fired_ns(shots.index))

    def fire(self, index: I64, pose_at: PoseAt, world: World) -> Shots:
        """Fire pulses into the world."""
        nominal = self.directions(index)
        stamps_ns = self.clock.simulated_ns(self.fired_ns(index))
        position, attitude = pose_at(stamps_ns)
        normal = self._normal.standard_normal((index.size, 4))
        uniform = self._uniform.random((index.size, 4))
        rays = self._rays(index, nominal, normal, position, attitude)
        depths, glint = self._layer_draws(index.size, world)
        time_s = np.asarray(stamps_ns * 1e-9, np.float64)
        c = world.cross(
            rays.origin,
            rays.direction,
            self.reach.most_m,
            depths[rays.at],
            thin_wires=False,
            time_s=time_s[rays.at],
        )
        true = np.zeros((3, index.size)), np.zeros((3, index.size)), np.full((3, index.size), NOTHING)
        draws = normal, uniform, self.reach.blind_m, self.noise.dropout
        first = REFLECTANCE[c.kind] * c.cosine
        report_single(rays.at, c.range_m, self.reach.limit_m(first), first, c.hit, *draws, *true)
        for met in self._several(c, index, rays, time_s, glint, world):
            merged = merge(met.echoes)
            limit_m = self.reach.limit_m(self.reach.faint(merged.bright))
            heard = met.echoes.range_m, met.echoes.bright, met.labels, merged.range_m, limit_m, merged.bright
            report_several(met.at, *heard, met.by_power, self.SEPARATION_M, *draws, *true)
        return self._in_air(self._measured(index, nominal, true, normal, uniform), rays, time_s)

    def _measured(
        self, index: I64, nominal: F64, true: tuple[F64, F64, I64], normal: F64, uniform: F64
    ) -> Shots:
        """Return the measurements of true returns: their ranges, brightnesses and hits, (3, n) each."""
        noise, (range_m, bright, hit) = self.noise, true
        flicker = np.maximum(1.0 + noise.intensity_sigma * self._flicker.standard_normal(index.size), 0.1)
        row_m = self._row_m[index % self.rows]
        shares = noise.range_sigma_m, noise.tail, noise.tail_factor, noise.ghost, noise.dust, noise.tagged
        false = [np.empty(index.size, np.bool_) for _ in range(3)]
        measure(np.exp(-range_m / 2.0), normal, uniform, flicker, row_m, *shares, *true, *false)
        return Shots(index, nominal, Echoes(*range_m, *bright[1:], *false), bright[0], Hits(*hit))

    def _several(
        self, c: Crossings, index: I64, rays: Rays, time_s: F64, glint: F64, world: World
    ) -> list[Several]:
        """Return the pulses with several echoes: those that layers or wires divide, then edges."""
        own, wires = self._widened(c, rays, world)
        found = []
        if own is not None:
            at, mine = rays.at[own], c.of(own)
            met = beam_echoes(
                mine,
                rays.origin[own],
                rays.direction[own],
                time_s[at],
                world.water,
                self.WAVELENGTH_NM,
                glint[at],
            )
            labels, by_power = echo_hits(mine), np.zeros(at.size, np.bool_)
            if wires is not None:
                met, labels = with_wires(met, wires.of(own)), np.hstack([labels, wires.index[own]])
                by_power = wires.share[own, 0] > 0.0
            found.append(Several(at, met, labels, by_power))
        if self.noise.divided and rays.at.size:
            beams, times = (rays.origin, rays.direction, rays.up), time_s[rays.at]
            edges = edge_echoes(world, c, beams, index[rays.at], own, self.beam, self.reach.most_m, times)
            if edges.at.size:
                met = BeamEchoes(edges.range_m, edges.bright)
                found.append(Several(rays.at[edges.at], met, edges.hit, np.ones(edges.at.size, np.bool_)))
        return found

    def _in_air(self, shots: Shots, rays: Rays, time_s: F64) -> Shots:
        """Return the shots with the returns of particles in the air, of the pulses that are traced."""
        if self.noise.particles is None:
            return shots
        direction = np.zeros((len(shots), 3))
        direction[rays.at] = rays.direction
        echoes, bright = self.noise.particles.add(
            shots.echoes, shots.bright, shots.index, direction, time_s, self._air_seed
        )
        return Shots(shots.index, shots.unit, echoes, bright, shots.hits.falsified(echoes))

    def _rays(self, index: I64, nominal: F64, normal: F64, position: F64, attitude: F64) -> Rays:
        """Return the rays of the traced pulses, with the error of their direction."""
        traced = self.is_traced(index)
        at = np.arange(index.size) if traced is None else np.flatnonzero(traced)
        if traced is not None:
            index, nominal, normal = index[at], nominal[at], normal[at]
            position, attitude = position[at], attitude[at]
        fired = tilt(nominal, normal, self.noise.angle_sigma_deg)
        origin = position + self.mount.lever_enu_m(attitude)
        offset = self.origins_m(index)
        if offset is not None:
            origin = origin + self.mount.to_enu(offset, attitude)
        return Rays(at, origin, self.mount.to_enu(fired, attitude), self.mount.up_enu(attitude))

    def _layer_draws(self, count: int, world: World) -> tuple[F64, F64]:
        """Return optical depths (n, parts) of leaves, and factors (n,) of glints, drawn only where needed."""
        if not world.has_layers:
            return np.empty((count, 0)), np.ones(count)
        depths = -np.log1p(-self._leaf.random((count, PARTS)))
        shape = world.water.facets
        return depths, self._glint.standard_gamma(shape, count) / shape

    def _widened(self, c: Crossings, rays: Rays, world: World) -> tuple[Flags | None, WireEchoes | None]:
        """Return the mask of pulses with more than an opaque surface, None for none, and their wires."""
        own = touched(c) if world.has_layers else None
        if own is not None and not own.any():
            own = None
        wires = None
        if world.wires:
            wires = world.wires.echoes(
                rays.origin, rays.direction, rays.up, c.range_m, self.reach.most_m, self.beam
            )
            wired = wires.share[:, 0] > 0.0
            if wired.any():
                own = wired if own is None else own | wired
            else:
                wires = None
        return own, wires

    def _pulses_before(self, time_ns: int) -> int:
        """Return the number of pulses fired before a simulated time."""
        low, high = self.pulses_about(self.clock.elapsed_ns(time_ns))
        low = max(0, low)
        index = np.arange(low, max(low, high), dtype=np.int64)
        return low + int(np.count_nonzero(self.clock.simulated_ns(self.fired_ns(index)) < time_ns))

    def _full_packets(self) -> list[bytes]:
        if self._pending is None:
            return []
        full = len(self._pending) // self.pulses_per_packet * self.pulses_per_packet
        if not full:
            return []
        packets = self.encode(self._pending[slice(full)])
        self._pending = self._pending[slice(full, None)]
        return packets
