"""Ouster OS1 and OS0: all beams of a column fire at once, returned as the sensor's own packets.

Data sheet (OS1, second generation): 32 rows from +22.5 to -22.5 degrees, 512 columns at 10 Hz; 45 m at 10 %
and 100 m at 80 % reflectivity, precision 1.5 cm. Data sheet (OS0, seventh revision): up to 128 rows from +45
to -45 degrees, 35 m at 10 % and 75 m at 80 %; here with 64 rows. Both at 865 nm, with one or two returns.
Beams leave the OS1 9.5 mm wide and diverge by 0.18 degrees, the OS0 5 mm and 0.35 degrees, full widths at
half maximum.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sitl.sensors.lidar_mount import Mount
from sitl.sensors.optics import Noise, Reach
from sitl.sensors.ouster_packets import PACKET_COLUMNS, UP_MM, encode_packets, metadata, packet_type
from sitl.sensors.pulse_lidar import PulseLidar, Shots
from sitl.sensors.sensor_clock import Clock
from sitl.world.wires import Beam

F64 = NDArray[np.float64]
I64 = NDArray[np.int64]

ROWS, COLUMNS, FRAME_NS = 32, 512, 100_000_000
REACH = Reach(blind_m=0.3, most_m=120.0, at_10_percent_m=45.0, at_80_percent_m=100.0)
NOISE = Noise(range_sigma_m=0.015, angle_sigma_deg=0.02, tail=0.012, intensity_sigma=0.17, row_sigma_m=0.005)
SIDEWAYS = Mount(pitch_deg=90.0)
"""Axis forward, connector up: the head sweeps the ground from side to side."""


@dataclass(frozen=True, slots=True)
class OusterModel:
    """Model of the family: its name in the metadata, rows, half its view, its reach and its beams."""

    product: str
    rows: int
    half_view_deg: float
    reach: Reach
    beam: Beam

    @property
    def elevation_deg(self) -> F64:
        """Elevation of the rows, the highest first."""
        return np.linspace(self.half_view_deg, -self.half_view_deg, self.rows)

    def metadata(self, dual: bool = False) -> str:
        """Return the metadata as from the sensor's HTTP API, JSON."""
        return metadata(self.elevation_deg, COLUMNS, self.product, dual)


def _round_beam(exit_m: float, divergence_deg: float) -> Beam:
    divergence = float(np.radians(divergence_deg))
    return Beam((exit_m, exit_m), (divergence, divergence))


OS1 = OusterModel("OS-1", ROWS, 22.5, REACH, _round_beam(0.0095, 0.18))
ELEVATION_DEG = OS1.elevation_deg
OS0 = OusterModel(
    "OS-0",
    64,
    45.0,
    Reach(blind_m=0.5, most_m=100.0, at_10_percent_m=35.0, at_80_percent_m=75.0),
    _round_beam(0.005, 0.35),
)


class Ouster(PulseLidar):
    """OS1-32 or OS0-64 on a moving vehicle.

    Parameters
    ----------
    rng, mount, clock, noise
        See ``PulseLidar``; by default mounted with its axis forward, so that it looks down and to both sides.
    point_rate_hz
        Pulses per second that are traced into the world, in whole columns; an OS1 fires 163 840, an OS0
        327 680, and the other columns are sent as not valid. None traces all.
    model
        `OS1` or `OS0`.
    dual
        Whether two returns are sent, the strongest and the second strongest, instead of one.
    """

    WAVELENGTH_NM = 865

    def __init__(
        self,
        rng: np.random.Generator,
        mount: Mount | None = None,
        *,
        point_rate_hz: int | None = None,
        model: OusterModel = OS1,
        dual: bool = False,
        clock: Clock | None = None,
        noise: Noise | None = None,
    ) -> None:
        self.beam = model.beam
        self.model, self.dual, self._rows = model, dual, model.rows
        super().__init__(
            rng, mount or SIDEWAYS, clock, noise or NOISE, model.reach, PACKET_COLUMNS * model.rows
        )
        rate_hz = model.rows * COLUMNS * 10
        self._every = 1 if point_rate_hz is None else max(1, round(rate_hz / point_rate_hz))
        self._elevation = np.radians(model.elevation_deg)
        self._layout = packet_type(model.rows, dual)

    @property
    def metadata(self) -> str:
        """Metadata as from the sensor's HTTP API, JSON."""
        return self.model.metadata(self.dual)

    @property
    def group(self) -> int:
        return PACKET_COLUMNS * self._rows

    @property
    def rows(self) -> int:
        return self._rows

    def fired_ns(self, index: I64) -> I64:
        return index // self._rows * FRAME_NS // COLUMNS

    def pulses_about(self, elapsed_ns: int) -> tuple[int, int]:
        column = elapsed_ns * COLUMNS // FRAME_NS
        return (column - 1) * self._rows, (column + 2) * self._rows

    def directions(self, index: I64) -> F64:
        """Return unit vectors: column 0 points back over the connector, and the head turns clockwise."""
        azimuth = np.pi - (2.0 * np.pi / COLUMNS) * (index // self._rows % COLUMNS)
        row = index % self._rows
        flat, up = np.cos(self._elevation)[row], np.sin(self._elevation)[row]
        return np.column_stack([flat * np.cos(azimuth), flat * np.sin(azimuth), up])

    def origins_m(self, index: I64) -> F64:
        return np.tile([0.0, 0.0, UP_MM * 1e-3], (len(index), 1))

    def is_traced(self, index: I64) -> NDArray[np.bool_] | None:
        return None if self._every == 1 else index // self._rows % self._every == 0

    def encode(self, shots: Shots) -> list[bytes]:
        firsts = shots.index[:: self._rows].reshape(-1, PACKET_COLUMNS)
        e = shots.echoes
        pairs = [(e.range_m, shots.bright)]
        if self.dual:
            # Of two returns the strongest is the last one or the one before it.
            second_is_last = e.range_m == e.other_m
            second_m = np.where(second_is_last, e.behind_m, e.other_m)
            second = np.where(second_is_last, e.behind_bright, e.other_bright)
            pairs.append((np.where(second_m == e.range_m, 0.0, second_m), second))
        shape = (*firsts.shape, self._rows)
        returns = [(m.reshape(shape), _reflectivity(m, bright).reshape(shape)) for m, bright in pairs]
        traced = self.is_traced(firsts)
        valid = True if traced is None else traced  # the others report no lost rays
        stamps_ns = self.clock.offset_ns + self.fired_ns(firsts)
        return encode_packets(self._layout, firsts[:, 0] // self._rows, COLUMNS, stamps_ns, returns, valid)


def _reflectivity(range_m: F64, bright: F64) -> NDArray[np.uint8]:
    """Return reflectivities in per cent, 0 without a return."""
    value = np.clip(np.rint(100.0 * bright), 1, 255).astype(np.uint8)
    return np.where(range_m > 0, value, 0).astype(np.uint8)
