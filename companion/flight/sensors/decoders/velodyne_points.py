"""Numba kernel that decodes many Velodyne packets into points, and the laser table of each model.

Elevations and azimuth offsets are from the user manuals (63-9243 VLP-16, 63-9318 Puck Hi-Res, 63-9325
VLP-32C), laser by laser; vertical offsets follow from the focus, within 0.05 mm of those listed for the
VLP-16.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from companion.flight.sensors.returns import thinning
from slz.kernels.argument_types import Array1D, Array2D, Array3D, ReadOnly2D
from slz.kernels.jit import kernel, kernel_part

BLOCKS, PLACES = 12, 32  # blocks of a packet; measurements of a block
BLOCK_BYTES = 100
TAIL_AT = BLOCKS * BLOCK_BYTES  # stamp, return mode, model
MODE_AT, MODEL_AT = TAIL_AT + 4, TAIL_AT + 5
DUAL = 0x39
TICK_NS = 2_304  # between two lasers
SEQUENCE_TICKS = 24  # between two firings of all lasers
CIRCLE = 36_000  # hundredths of a degree
MOST_PER_TICK = CIRCLE * 25 * TICK_NS * 1e-9  # at 5 to 20 turns a second; more is an omitted sector
NUMBER = np.full(256, -1)  # row of a model in the tables, by its factory byte


@dataclass(frozen=True, slots=True)
class Lasers:
    """Elevation and azimuth of the lasers (deg), and the unit of ranges (m).

    focus_m: distance from the axis to the point where all beams cross, level with the origin; a beam begins
    above or below it.
    """

    elevation_deg: tuple[float, ...]
    azimuth_deg: tuple[float, ...]
    focus_m: float
    unit_m: float


VLP16 = Lasers(
    elevation_deg=(-15, 1, -13, 3, -11, 5, -9, 7, -7, 9, -5, 11, -3, 13, -1, 15),
    azimuth_deg=(0,) * 16,
    focus_m=0.04191,
    unit_m=0.002,
)
PUCK_HI_RES = Lasers(
    elevation_deg=(
        -10, 0.667, -8.667, 2, -7.333, 3.333, -6, 4.667, -4.667, 6, -3.333, 7.333, -2, 8.667, -0.667, 10,
    ),
    azimuth_deg=(0,) * 16,
    focus_m=0.04191,
    unit_m=0.002,
)  # fmt: skip
VLP32C = Lasers(
    elevation_deg=(
        -25, -1, -1.667, -15.639, -11.31, 0, -0.667, -8.843, -7.254, 0.333, -0.333, -6.148, -5.333, 1.333,
        0.667, -4, -4.667, 1.667, 1, -3.667, -3.333, 3.333, 2.333, -2.667, -3, 7, 4.667, -2.333, -2, 15,
        10.333, -1.333,
    ),
    azimuth_deg=(
        1.4, -4.2, 1.4, -1.4, 1.4, -1.4, 4.2, -1.4, 1.4, -4.2, 1.4, -1.4, 4.2, -1.4, 4.2, -1.4, 1.4, -4.2,
        1.4, -4.2, 4.2, -1.4, 1.4, -1.4, 1.4, -1.4, 1.4, -4.2, 4.2, -1.4, 1.4, -1.4,
    ),
    focus_m=0.0424,
    unit_m=0.004,
)  # fmt: skip
MODELS = {0x22: VLP16, 0x24: PUCK_HI_RES, 0x28: VLP32C}
SEQUENCES = {model: BLOCKS * PLACES // len(lasers.elevation_deg) for model, lasers in MODELS.items()}


def _table(lasers: Lasers) -> tuple[list[list[float]], list[int], list[int]]:
    """Return, for each place of a block, its shape (across m, up m, offset m, azimuth rad), tick and ring."""
    n = len(lasers.elevation_deg)
    rings = np.argsort(np.argsort(lasers.elevation_deg))
    shape, ticks, ring = [], [], []
    for place in range(PLACES):
        laser = place % n
        elevation = math.radians(lasers.elevation_deg[laser])
        across_m, up_m = lasers.unit_m * math.cos(elevation), lasers.unit_m * math.sin(elevation)
        turn = math.radians(lasers.azimuth_deg[laser])
        shape.append([across_m, up_m, -lasers.focus_m * math.tan(elevation), turn])
        ticks.append(place // 2 if n == PLACES else place // n * SEQUENCE_TICKS + laser)
        ring.append(int(rings[laser]))
    return shape, ticks, ring


_TABLES = [_table(lasers) for lasers in MODELS.values()]
SHAPE = np.array([shape for shape, _, _ in _TABLES])
TICKS = np.array([ticks for _, ticks, _ in _TABLES])
RING = np.array([ring for _, _, ring in _TABLES], np.uint8)
BLOCK_TICKS = np.array([SEQUENCE_TICKS * count // BLOCKS for count in SEQUENCES.values()])
NUMBER[list(MODELS)] = range(len(MODELS))
THINNING = np.array(
    [thinning(len(lasers.elevation_deg) / (SEQUENCE_TICKS * TICK_NS * 1e-9)) for lasers in MODELS.values()]
)


@kernel_part
def _u16(packets: ReadOnly2D[np.uint8], packet: int, at: int) -> int:
    return int(packets[packet, at]) | int(packets[packet, at + 1]) << 8


@kernel_part
def _turn_per_tick(packets: ReadOnly2D[np.uint8], packet: int, step: int, ticks: int) -> float:
    """Return the mean turn per tick, in 0.01 degrees, without steps over an omitted sector."""
    turned, times = 0, 0
    for block in range(0, BLOCKS - step, step):
        before = _u16(packets, packet, block * BLOCK_BYTES + 2)
        ahead = (_u16(packets, packet, (block + step) * BLOCK_BYTES + 2) - before + CIRCLE) % CIRCLE
        if ahead <= MOST_PER_TICK * ticks:
            turned += ahead
            times += 1
    return turned / (times * ticks) if times else 0.0


@kernel
def place_rays(
    packets: ReadOnly2D[np.uint8],
    stamps_ns: Array1D[np.int64],
    number: Array1D[np.int64],
    shape: Array3D[np.float64],
    ticks: Array2D[np.int64],
    rings: Array2D[np.uint8],
    block_ticks: Array1D[np.int64],
    every: Array1D[np.int64],
    absent_before: int,
    xyz_m: Array2D[np.float32],
    stamp_ns: Array1D[np.int64],
    intensity: Array1D[np.uint8],
    ring: Array1D[np.uint8],
    echo: Array1D[np.uint8],
    echoes: Array1D[np.uint8],
    lost: Array2D[np.float32],
    lost_ns: Array1D[np.int64],
) -> tuple[int, int, int]:
    """Project the measurements of packets to points; a distance of zero is no return.

    The lasers turn while they fire, at the mean rate of the packet's own steps from block to block.

    Parameters
    ----------
    packets, stamps_ns
        (packets, 1206) uint8, checked, of known models; the time of each one's first firing.
    number, shape, ticks, rings, block_ticks, every
        `NUMBER`, `SHAPE`, `TICKS`, `RING`, `BLOCK_TICKS`, `THINNING`.
    absent_before
        Number of rays without a return in earlier packets.
    xyz_m, stamp_ns, intensity, ring, echo, echoes
        Filled from the front; as in `RawReturns`. Of two returns of a ray the nearer is the first.
    lost, lost_ns
        The same, for every k-th ray without a return.

    Returns
    -------
    tuple
        Points, rays without a return, and those of them in `lost`.
    """
    kept, absent, n_lost = 0, 0, 0
    cos_ahead, sin_ahead = np.empty(PLACES), np.empty(PLACES)
    for packet in range(len(packets)):
        model = number[packets[packet, MODEL_AT]]
        step = 2 if packets[packet, MODE_AT] == DUAL else 1
        per_tick = _turn_per_tick(packets, packet, step, block_ticks[model]) * (2 * math.pi / CIRCLE)
        for place in range(PLACES):
            ahead = per_tick * ticks[model, place] + shape[model, place, 3]
            cos_ahead[place] = math.cos(ahead) * shape[model, place, 0]
            sin_ahead[place] = math.sin(ahead) * shape[model, place, 0]
        for block in range(0, BLOCKS, step):
            at = block * BLOCK_BYTES + 2
            azimuth = _u16(packets, packet, at) * (2 * math.pi / CIRCLE)
            forward, right = math.cos(azimuth), math.sin(azimuth)
            begun_ns = stamps_ns[packet] + block // step * block_ticks[model] * TICK_NS
            for place in range(PLACES):
                at += 2 if place == 0 else 3
                last = _u16(packets, packet, at)
                other = _u16(packets, packet, at + BLOCK_BYTES) if step == 2 else last
                if last == 0 and other == 0:
                    if (absent_before + absent) % every[model] == 0:
                        across, up = shape[model, place, 0], shape[model, place, 1]
                        unit = 1 / math.sqrt(across * across + up * up)
                        lost[n_lost, 0] = (forward * cos_ahead[place] - right * sin_ahead[place]) * unit
                        lost[n_lost, 1] = (-right * cos_ahead[place] - forward * sin_ahead[place]) * unit
                        lost[n_lost, 2] = up * unit
                        lost_ns[n_lost] = begun_ns + ticks[model, place] * TICK_NS
                        n_lost += 1
                    absent += 1
                    continue
                both = last != other and last > 0 and other > 0
                x = forward * cos_ahead[place] - right * sin_ahead[place]
                y = -right * cos_ahead[place] - forward * sin_ahead[place]
                for k in range(2):  # the last return, then the strongest; one of two equal ones
                    distance = other if k else last
                    if distance == 0 or (k == 0 and last == other):
                        continue
                    xyz_m[kept, 0], xyz_m[kept, 1] = x * distance, y * distance
                    xyz_m[kept, 2] = shape[model, place, 1] * distance + shape[model, place, 2]
                    stamp_ns[kept] = begun_ns + ticks[model, place] * TICK_NS
                    intensity[kept] = packets[packet, at + 2 + (BLOCK_BYTES if k and step == 2 else 0)]
                    ring[kept] = rings[model, place]
                    echo[kept] = 2 if both and distance == max(last, other) else 1
                    echoes[kept] = 2 if both else 1
                    kept += 1
    return kept, absent, n_lost
