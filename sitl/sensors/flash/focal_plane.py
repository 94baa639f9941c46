"""Focal plane array: light in, ring buffers of counts out.

Each pixel samples its photocurrent on the common clock into a ring of `n_samples`. When a sample crosses the
threshold, the pixel takes `after_trigger` more and stops; the last sample is pulled down to nearly zero as
the end marker. The clock's count at the end is stored too. A pixel that never triggers holds noise, and the
count at which the range gate closes.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

F64 = NDArray[np.float64]
C_M_NS = 0.299792458


@dataclass(frozen=True, slots=True)
class RawFrame:
    """Raw frame: ring buffers (rows, cols, n) uint16, counters (rows, cols) uint32, time of the flash."""

    samples: NDArray[np.uint16]
    counter: NDArray[np.uint32]
    stamp_ns: int


@dataclass(frozen=True, slots=True)
class FocalPlane:
    """Electronics of the focal plane.

    Attributes
    ----------
    tick_ns
        Period of the clock.
    pulse_ns
        Width of the laser pulse, FWHM.
    dark_counts, noise_counts
        Mean and standard deviation of a sample without light.
    full_counts
        Clipping level of the converter.
    threshold_counts
        Trigger level of a pixel above the dark level.
    after_trigger
        Samples taken after the triggering one.
    false_trigger
        Share of pixels triggered by noise at a random time, before any light.
    dead
        Share of pixels that never respond, always the same ones.
    """

    rows: int = 128
    cols: int = 128
    n_samples: int = 20
    tick_ns: float = 2.4
    pulse_ns: float = 10.0
    dark_counts: float = 300.0
    noise_counts: float = 60.0
    full_counts: int = 4095
    threshold_counts: float = 300.0
    after_trigger: int = 11
    gate_ticks: int = 4_000
    false_trigger: float = 2e-4
    dead: float = 1e-3

    def expose(
        self, delays_ns: F64, heights: F64, rng: np.random.Generator, dead: NDArray[np.bool_], stamp_ns: int
    ) -> RawFrame:
        """Record the echoes of one flash.

        Parameters
        ----------
        delays_ns, heights
            (rows, cols, k): times and heights in counts of the echoes within each pixel; height 0 is no echo.
        dead
            (rows, cols) pixels that do not respond.
        """
        shape = self.rows, self.cols
        delays_ns = np.where(heights > 0, delays_ns, np.inf)
        first = np.min(delays_ns, axis=2)
        lit = np.isfinite(first) & ~dead
        # Only samples around the first echo matter: three buffer lengths, from one and a half before it.
        start = np.where(lit, np.floor(np.where(lit, first, 0.0) / self.tick_ns), 0).astype(np.int64)
        start -= self.n_samples // 2 + self.n_samples
        span = 3 * self.n_samples
        light = self._light(start, span, delays_ns, heights, lit)
        counts = light + self.dark_counts + self.noise_counts * rng.standard_normal((*shape, span))
        stop, triggered = self._stop(counts, lit, start)
        early = (rng.random(shape) < self.false_trigger) & ~dead
        rings, counter = self._read_out(counts, start, stop)
        noise_only = self.dark_counts + self.noise_counts * rng.standard_normal((*shape, self.n_samples))
        rings = np.where((triggered & ~early)[..., np.newaxis], rings, noise_only)
        any_time = rng.integers(self.n_samples, self.gate_ticks, shape)
        counter = np.where(early, any_time, np.where(triggered, counter, self.gate_ticks))
        samples = np.clip(np.rint(rings), 20, self.full_counts).astype(np.uint16)
        return self._wrapped(samples, counter.astype(np.uint32), rng, stamp_ns)

    def _light(
        self, start: NDArray[np.int64], span: int, delays_ns: F64, heights: F64, lit: NDArray[np.bool_]
    ) -> F64:
        """Return the photocurrent (rows, cols, span) at the ticks from `start` on."""
        width = self.pulse_ns / np.sqrt(8 * np.log(2))
        out = np.zeros((self.rows, self.cols, span))
        ticks = (start[..., np.newaxis] + np.arange(span)) * self.tick_ns
        for k in range(delays_ns.shape[2]):
            there = lit & (heights[..., k] > 0)
            late = ticks[there] - delays_ns[there, k, np.newaxis]
            out[there] += heights[there, k, np.newaxis] * np.exp(-0.5 * (late / width) ** 2)
        return out

    def _stop(
        self, counts: F64, lit: NDArray[np.bool_], start: NDArray[np.int64]
    ) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
        """Return the index of the last sample taken and the mask of triggered pixels."""
        over = counts[..., self.n_samples :] > self.dark_counts + self.threshold_counts
        triggered = lit & over.any(axis=2)
        stop = np.argmax(over, axis=2) + self.n_samples + self.after_trigger
        stop = np.minimum(stop, counts.shape[2] - 1)
        triggered &= start + stop < self.gate_ticks
        return stop, triggered

    def _read_out(
        self, counts: F64, start: NDArray[np.int64], stop: NDArray[np.int64]
    ) -> tuple[F64, NDArray[np.int64]]:
        index = stop[..., np.newaxis] - (self.n_samples - 1) + np.arange(self.n_samples)
        return np.take_along_axis(counts, np.maximum(index, 0), axis=2), start + stop

    def _wrapped(
        self,
        samples: NDArray[np.uint16],
        counter: NDArray[np.uint32],
        rng: np.random.Generator,
        stamp_ns: int,
    ) -> RawFrame:
        """Mark the last sample and rotate every ring to the random start of its writing."""
        samples[..., -1] = 0
        turn = rng.integers(0, self.n_samples, counter.shape)
        index = (np.arange(self.n_samples) - turn[..., np.newaxis]) % self.n_samples
        return RawFrame(np.take_along_axis(samples, index, axis=2), counter, stamp_ns)
