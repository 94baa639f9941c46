"""Directions of a Livox sensor's rays without a return, reconstructed from the returns around them.

In Cartesian packets such a ray is a point of zeros: it has a time and a laser line, but no direction. The
mirror turns at a constant rate and the elevation of a line changes slowly, so within a turn both angles of a
line are a parabola in time and a sinusoid of the mirror's angle, fitted to its returns. The maker publishes
no pattern, and none is assumed: where the returns do not follow the fit, the directions stay unknown.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from slz.kernels.argument_types import Array1D, Array2D, Array3D, ReadOnly1D, ReadOnly2D
from slz.kernels.jit import kernel, kernel_part

Points = NDArray[np.float32]
Stamps = NDArray[np.int64]
Lines = NDArray[np.uint8]

Directed = tuple[
    Array2D[np.float32], Array1D[np.int64], int, Array2D[np.float32], Array1D[np.int64], Array1D[np.uint8],
    Array1D[np.int64], Array1D[np.uint8],
]  # fmt: skip

LINES = 4
TERMS = 5  # 1, t, t squared, cosine and sine of the mirror's angle
TURNS = 1.5  # of the mirror, in a fit
MOST_SAMPLES = 32  # returns of a line in a fit
LEAST_SAMPLES = 12
MOST_ERROR_RAD = math.radians(1.5)
MOST_WRONG = 0.05  # share of the returns that may exceed it
MOST_GAP = 0.55  # turns from a ray to the nearest returns before and after it
NEAR_NS = 100_000  # between two returns of a line, to estimate the mirror's rate
RATES = 101  # estimates of the rate, of which the median is used
TAIL_NS = 9_000_000  # of returns kept for the next batch, at least `TURNS`
WAIT_NS = 4_000_000  # that a ray may wait for a return after it, more than `MOST_GAP`
SLOWEST, FASTEST = 2 * math.pi * 20, 2 * math.pi * 600  # rad/s


@kernel_part
def _wrap(angle: float) -> float:
    return angle - 2 * math.pi * math.floor(angle / (2 * math.pi) + 0.5)


@kernel_part
def _mirror_rate(
    xyz_m: ReadOnly2D[np.float32], stamp_ns: ReadOnly1D[np.int64], ring: ReadOnly1D[np.uint8]
) -> float:
    """Return the median rate of the azimuth between neighbours of a line (rad/ns), NaN without enough."""
    rates = np.empty(RATES)
    found, n = 0, len(stamp_ns)
    step = max(1, n // (2 * RATES))
    for i in range(0, n, step):
        for j in range(i + 1, min(n, i + 4 * LINES)):
            since = stamp_ns[j] - stamp_ns[i]
            if ring[j] == ring[i] and 0 < since <= NEAR_NS and found < RATES:
                ahead = math.atan2(xyz_m[j, 1], xyz_m[j, 0]) - math.atan2(xyz_m[i, 1], xyz_m[i, 0])
                rates[found] = _wrap(ahead) / since
                found += 1
                break
    return float(np.median(rates[:found])) if found >= LEAST_SAMPLES else np.nan


@kernel_part
def _solve(matrix: Array2D[np.float64], right: Array2D[np.float64]) -> bool:
    """Solve symmetric equations, given by their upper half, in place; return whether they are well posed."""
    n = len(matrix)
    for k in range(n):
        if not matrix[k, k] > 1e-9:
            return False
        for i in range(k + 1, n):
            share = matrix[k, i] / matrix[k, k]
            for j in range(i, n):
                matrix[i, j] -= share * matrix[k, j]
            for j in range(right.shape[1]):
                right[i, j] -= share * right[k, j]
    for k in range(n - 1, -1, -1):
        for j in range(right.shape[1]):
            for i in range(k + 1, n):
                right[k, j] -= matrix[k, i] * right[i, j]
            right[k, j] /= matrix[k, k]
    return True


@kernel_part
def _terms(since: float, half: float, rate: float, terms: Array1D[np.float64]) -> None:
    u = since / half
    terms[0], terms[1], terms[2] = 1.0, u, u * u
    terms[3], terms[4] = math.cos(rate * since), math.sin(rate * since)


@kernel_part
def _sample(
    xyz_m: ReadOnly2D[np.float32],
    stamp_ns: ReadOnly1D[np.int64],
    ring: ReadOnly1D[np.uint8],
    centre_ns: np.int64,
    half_ns: float,
    rate: float,
    samples: Array3D[np.float64],
    counts: Array1D[np.int64],
) -> None:
    """Choose returns of every line, evenly in time within `half_ns` of the centre, and count them.

    samples: (LINES, MOST_SAMPLES, 4), filled with time (ns), azimuth less the mirror's turn, elevation,
    cosine of the elevation.
    """
    counts[:] = 0
    step = 2 * half_ns / MOST_SAMPLES
    due = np.full(LINES, -half_ns)
    for i in range(np.searchsorted(stamp_ns, centre_ns - np.int64(half_ns)), len(stamp_ns)):
        line, since = int(ring[i]) % LINES, float(stamp_ns[i] - centre_ns)
        if since >= half_ns:
            break
        if since < due[line] or counts[line] == MOST_SAMPLES:
            continue
        due[line] = -half_ns + step * (1 + math.floor((since + half_ns) / step))
        x, y, z = float(xyz_m[i, 0]), float(xyz_m[i, 1]), float(xyz_m[i, 2])
        chosen = samples[line, counts[line]]
        chosen[0] = since
        chosen[1] = math.atan2(y, x) - rate * since
        flat = math.sqrt(x * x + y * y)
        chosen[2], chosen[3] = math.atan2(z, flat), flat / math.sqrt(x * x + y * y + z * z)
        counts[line] += 1


@kernel_part
def _fit(samples: Array2D[np.float64], half_ns: float, rate: float, model: Array2D[np.float64]) -> bool:
    """Fit azimuth, less the mirror's turn, and elevation of a line; return whether its returns follow.

    model: (TERMS, 2), filled with the coefficients.
    """
    n = len(samples)
    if n < LEAST_SAMPLES:
        return False
    middle = samples[n // 2, 1]
    matrix, terms = np.zeros((TERMS, TERMS)), np.empty((n, TERMS))
    model[:] = 0.0
    for i in range(n):
        samples[i, 1] = middle + _wrap(samples[i, 1] - middle)
        _terms(samples[i, 0], half_ns, rate, terms[i])
        for j in range(TERMS):
            for k in range(j, TERMS):  # the upper half, of which elimination needs no more
                matrix[j, k] += terms[i, j] * terms[i, k]
            model[j, 0] += terms[i, j] * samples[i, 1]
            model[j, 1] += terms[i, j] * samples[i, 2]
    if not _solve(matrix, model):
        return False
    wrong = 0
    for i in range(n):
        azimuth, elevation = 0.0, 0.0
        for j in range(TERMS):
            azimuth += terms[i, j] * model[j, 0]
            elevation += terms[i, j] * model[j, 1]
        across = (azimuth - samples[i, 1]) * samples[i, 3]
        up = elevation - samples[i, 2]
        wrong += across * across + up * up > MOST_ERROR_RAD * MOST_ERROR_RAD
    return wrong <= MOST_WRONG * n


@kernel
def _reconstruct(
    xyz_m: ReadOnly2D[np.float32],
    stamp_ns: ReadOnly1D[np.int64],
    ring: ReadOnly1D[np.uint8],
    lost_ns: ReadOnly1D[np.int64],
    lost_ring: ReadOnly1D[np.uint8],
    lost: Array2D[np.float32],
) -> None:
    """Write the directions of lost rays, in the order of their stamps, NaN where unknown."""
    lost[:] = np.nan
    rate = _mirror_rate(xyz_m, stamp_ns, ring)
    if not SLOWEST <= abs(rate) * 1e9 <= FASTEST:
        return
    turn_ns = 2 * math.pi / abs(rate)
    half_ns = TURNS / 2 * turn_ns
    begin_ns, end_ns = stamp_ns[0], stamp_ns[-1]
    model, terms = np.empty((LINES, TERMS, 2)), np.empty(TERMS)
    samples, counts = np.empty((LINES, MOST_SAMPLES, 4)), np.empty(LINES, np.int64)
    sound = np.zeros(LINES, np.bool_)
    number, centre_ns = -1, np.int64(0)
    after, n = 0, len(stamp_ns)
    for i in range(len(lost_ns)):
        t = lost_ns[i]
        while after < n and stamp_ns[after] <= t:
            after += 1
        if after == 0 or after == n:
            continue
        if max(t - stamp_ns[after - 1], stamp_ns[after] - t) > MOST_GAP * turn_ns:
            continue
        here = int((t - begin_ns) / turn_ns)
        if here != number:
            number = here
            middle = begin_ns + (here + 0.5) * turn_ns
            centre_ns = np.int64(max(begin_ns + half_ns, min(end_ns - half_ns, middle)))
            _sample(xyz_m, stamp_ns, ring, centre_ns, half_ns, rate, samples, counts)
            for line in range(LINES):
                sound[line] = _fit(samples[line, : counts[line]], half_ns, rate, model[line])
        line = int(lost_ring[i])
        if not sound[line]:
            continue
        since = float(t - centre_ns)
        _terms(since, half_ns, rate, terms)
        azimuth, elevation = rate * since, 0.0
        for j in range(TERMS):
            azimuth += terms[j] * model[line, j, 0]
            elevation += terms[j] * model[line, j, 1]
        flat = math.cos(elevation)
        lost[i, 0], lost[i, 1] = flat * math.cos(azimuth), flat * math.sin(azimuth)
        lost[i, 2] = math.sin(elevation)


@kernel_part
def _in_time(first_ns: Array1D[np.int64], then_ns: Array1D[np.int64]) -> Array1D[np.int64]:
    """Return the order of the stamps of two arrays; few are out of order."""
    n = len(first_ns)
    stamps, order = np.empty(n + len(then_ns), np.int64), np.arange(n + len(then_ns))
    stamps[:n], stamps[n:] = first_ns, then_ns
    for i in range(1, len(stamps)):
        stamp, number, k = stamps[i], order[i], i
        while k > 0 and stamps[k - 1] > stamp:
            stamps[k], order[k] = stamps[k - 1], order[k - 1]
            k -= 1
        stamps[k], order[k] = stamp, number
    return order


@kernel
def _directed(
    tail_m: Array2D[np.float32],
    tail_ns: Array1D[np.int64],
    tail_ring: Array1D[np.uint8],
    xyz_m: Array2D[np.float32],
    stamp_ns: Array1D[np.int64],
    ring: Array1D[np.uint8],
    wait_ns: Array1D[np.int64],
    wait_ring: Array1D[np.uint8],
    lost: Array2D[np.float32],
    lost_ns: Array1D[np.int64],
    lost_ring: Array1D[np.uint8],
) -> Directed:
    """Return directions and stamps of lost rays, how many have none, and what the next batch needs.

    tail_m, tail_ns, tail_ring, wait_ns, wait_ring: what this one needs of the batch before. The rest as in
    `ScanPattern.direct`.
    """
    before, newest_ns = len(tail_ns), np.int64(0)
    order = _in_time(tail_ns, stamp_ns)
    places, stamps = np.empty((len(order), 3), np.float32), np.empty(len(order), np.int64)
    lines = np.empty(len(order), np.uint8)
    for k in range(len(order)):
        i = order[k]
        if i < before:
            places[k], stamps[k], lines[k] = tail_m[i], tail_ns[i], tail_ring[i]
        else:
            places[k], stamps[k], lines[k] = xyz_m[i - before], stamp_ns[i - before], ring[i - before]
            newest_ns = max(newest_ns, stamps[k])
    most = len(wait_ns) + len(lost_ns)
    out, out_ns = np.empty((most, 3), np.float32), np.empty(most, np.int64)
    rays_ns, rays_ring = np.empty(most, np.int64), np.empty(most, np.uint8)
    for i in range(len(wait_ns)):
        rays_ns[i], rays_ring[i] = wait_ns[i], wait_ring[i]
    n, m = 0, len(wait_ns)
    for i in range(len(lost_ns)):
        newest_ns = max(newest_ns, lost_ns[i])
        if np.isnan(lost[i, 0]):
            rays_ns[m], rays_ring[m] = lost_ns[i], lost_ring[i]
            m += 1
        else:
            out[n], out_ns[n] = lost[i], lost_ns[i]
            n += 1
    order = _in_time(rays_ns[:m], rays_ns[:0])
    sorted_ns, sorted_ring, found = np.empty(m, np.int64), np.empty(m, np.uint8), np.empty((m, 3), np.float32)
    for k in range(m):
        sorted_ns[k], sorted_ring[k] = rays_ns[order[k]], rays_ring[order[k]]
    _reconstruct(places, stamps, lines, sorted_ns, sorted_ring, found)
    at = np.empty(m, np.int64)
    for k in range(m):
        at[order[k]] = k
    waits, absent = 0, 0
    for i in range(m):
        if np.isfinite(found[at[i], 0]):
            out[n], out_ns[n] = found[at[i]], rays_ns[i]
            n += 1
        elif abs(newest_ns - rays_ns[i]) <= WAIT_NS:
            rays_ns[waits], rays_ring[waits] = rays_ns[i], rays_ring[i]
            waits += 1
        else:
            absent += 1
    first, stop = np.searchsorted(stamps, newest_ns - TAIL_NS), np.searchsorted(stamps, newest_ns + 1)
    tail = places[first:stop], stamps[first:stop], lines[first:stop]
    return out[:n], out_ns[:n], absent, *tail, rays_ns[:waits], rays_ring[:waits]


def reconstruct_directions(
    xyz_m: NDArray[np.float32],
    stamp_ns: NDArray[np.int64],
    ring: NDArray[np.uint8],
    lost_ns: NDArray[np.int64],
    lost_ring: NDArray[np.uint8],
) -> NDArray[np.float32]:
    """Return unit vectors (m, 3) along rays without a return, NaN where the returns do not give them.

    Parameters
    ----------
    xyz_m, stamp_ns, ring
        Returns of the same sensor, (n, 3), (n,), (n,).
    lost_ns, lost_ring
        Stamps and lines of the rays, (m,).
    """
    found = np.full((len(lost_ns), 3), np.nan, np.float32)
    if not len(stamp_ns):
        return found
    xyz_m, stamp_ns, ring = _in_order(xyz_m, stamp_ns, ring)
    if not (lost_ns[1:] < lost_ns[:-1]).any():
        _reconstruct(xyz_m, stamp_ns, ring, lost_ns, lost_ring, found)
        return found
    order = np.argsort(lost_ns, kind="stable")
    sorted_rays = np.empty_like(found)
    _reconstruct(xyz_m, stamp_ns, ring, lost_ns[order], lost_ring[order], sorted_rays)
    found[order] = sorted_rays
    return found


def _in_order(xyz_m: Points, stamp_ns: Stamps, ring: Lines) -> tuple[Points, Stamps, Lines]:
    """Return returns in the order of their stamps; packets may arrive in another."""
    if not (stamp_ns[1:] < stamp_ns[:-1]).any():
        return xyz_m, stamp_ns, ring
    order = np.argsort(stamp_ns, kind="stable")
    return xyz_m[order], stamp_ns[order], ring[order]


class ScanPattern:
    """Directions of lost rays batch by batch.

    The last returns of a batch serve the next one too, and a ray that no return has followed yet waits for
    the next batch: else a sector without returns that a batch cuts in two would lose its rays.
    """

    def __init__(self) -> None:
        none_ns, none_ring = np.empty(0, np.int64), np.empty(0, np.uint8)
        self._tail: tuple[Points, Stamps, Lines] = np.empty((0, 3), np.float32), none_ns, none_ring
        self._waiting: tuple[Stamps, Lines] = none_ns, none_ring

    @property
    def waiting(self) -> int:
        """Number of rays that wait for the next batch."""
        return len(self._waiting[0])

    def direct(
        self,
        xyz_m: NDArray[np.float32],
        stamp_ns: NDArray[np.int64],
        ring: NDArray[np.uint8],
        lost: NDArray[np.float32],
        lost_ns: NDArray[np.int64],
        lost_ring: NDArray[np.uint8],
    ) -> tuple[NDArray[np.float32], NDArray[np.int64], int]:
        """Return directions and stamps of lost rays, and the number of those left without a direction.

        Parameters
        ----------
        xyz_m, stamp_ns, ring
            Returns of the batch.
        lost, lost_ns, lost_ring
            Its lost rays; directions that are NaN are reconstructed.
        """
        if not self.waiting and not np.isnan(lost[:, 0]).any():
            return lost, lost_ns, 0
        found, found_ns, absent, places, stamps, lines, wait_ns, wait_ring = _directed(
            *(*self._tail, xyz_m, stamp_ns, ring), *(*self._waiting, lost, lost_ns, lost_ring)
        )
        self._tail, self._waiting = (places, stamps, lines), (wait_ns, wait_ring)
        return found, found_ns, absent
