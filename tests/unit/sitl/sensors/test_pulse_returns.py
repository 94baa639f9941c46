"""What a receiver reports and measures of echoes, against plain NumPy."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from sitl.sensors.layer_echoes import BeamEchoes, merge
from sitl.sensors.pulse_returns import measure, report_several
from sitl.world.hits import DUST, GHOST, NOTHING

F64 = NDArray[np.float64]
LIMIT_M, DROPOUT, SEPARATION_M, FAINTEST, PULSE_M = 60.0, 0.1, 1.0, 1e-4, 0.3
STRONGEST, LAST, OTHER = range(3)


def reported(echoes: BeamEchoes, least: float, by_power: bool = False) -> tuple[F64, F64]:
    """Return ranges and brightnesses (3,) reported of one pulse that sees echoes from a brightness on."""
    merged, one = merge(echoes), np.zeros((1, 4)) + 0.5
    limit_m = np.where(merged.bright > least, np.inf, 0.0)
    out = np.zeros((3, 1)), np.zeros((3, 1)), np.zeros((3, 1), np.int64)
    labels = np.zeros(echoes.range_m.shape, np.int64)
    heard = echoes.range_m, echoes.bright, labels, merged.range_m, limit_m, merged.bright
    report_several(np.zeros(1, np.int64), *heard, np.array([by_power]), 1.0, one, one, 0.1, 0.0, *out)
    return out[0][:, 0], out[1][:, 0]


def test_a_sensor_of_one_return_reports_the_strongest() -> None:
    bright = np.array([[0.10, 0.12, 0.30, 0.0]])
    range_m, found = reported(BeamEchoes(np.array([[10.0, 11.0, 12.5, np.nan]]), bright), 0.05)
    assert (range_m[STRONGEST], found[STRONGEST]) == (12.5, 0.30)
    assert (range_m[LAST], range_m[OTHER]) == pytest.approx((12.5, 11.0))


def test_two_returns_are_the_last_and_the_strongest() -> None:
    bright = np.array([[0.40, 0.12, 0.30]])
    range_m, _ = reported(BeamEchoes(np.array([[10.0, 11.0, 12.5]]), bright), 0.2)
    assert range_m.tolist() == [10.0, 12.5, 10.0]
    near, _ = reported(BeamEchoes(np.array([[10.0, 10.6]]), bright[:, :2]), 0.1)
    assert near[LAST] == near[OTHER] == 10.0


def test_by_power_a_near_faint_echo_is_the_strongest() -> None:
    echoes = BeamEchoes(np.array([[10.0, 40.0]]), np.array([[0.1, 0.3]]))
    assert [reported(echoes, 0.05, by_power)[0][STRONGEST] for by_power in (False, True)] == [40.0, 10.0]


def test_echoes_within_a_pulse_add_up_at_their_mean() -> None:
    merged = merge(BeamEchoes(np.array([[10.0, 10.2, 14.0]]), np.array([[0.1, 0.3, 0.2]])))
    np.testing.assert_allclose(merged.range_m, [[10.15, 10.15, 14.0]])
    np.testing.assert_allclose(merged.bright, [[0.4, 0.4, 0.2]])


def drawn(columns: int, n: int = 4000) -> tuple[BeamEchoes, np.random.Generator]:
    """Return echoes of pulses, many near one another, some missing or dark."""
    rng = np.random.default_rng(columns)
    range_m = rng.choice([5.0, 12.0, 14.0, 40.0], (n, columns)) + rng.uniform(0.0, 0.4, (n, columns))
    bright = rng.uniform(0.0, 0.6, (n, columns)) * rng.integers(0, 2, (n, columns))
    range_m[rng.random((n, columns)) < 0.2] = np.nan
    return BeamEchoes(range_m, bright), rng


@pytest.mark.parametrize("columns", [2, 5, 7, 8])
def test_overlapping_echoes_have_the_sums_of_numpy_to_the_last_bit(columns: int) -> None:
    echoes, _ = drawn(columns)
    lit = np.isfinite(echoes.range_m) & (echoes.bright > 0.0)
    range_m = np.where(lit, echoes.range_m, np.inf)
    with np.errstate(invalid="ignore", divide="ignore"):
        near = np.abs(range_m[:, :, np.newaxis] - range_m[:, np.newaxis, :]) <= PULSE_M
        power = near * np.where(lit, echoes.bright, 0.0)[:, np.newaxis, :]
        moment = (power * np.where(lit, echoes.range_m, 0.0)[:, np.newaxis, :]).sum(axis=2)
        expected = np.where(lit, moment / power.sum(axis=2), np.nan)
    found = merge(echoes)
    assert found.range_m.tobytes() == expected.tobytes()
    assert found.bright.tobytes() == np.where(lit, power.sum(axis=2), 0.0).tobytes()


def row_by_row(echoes: BeamEchoes, merged: BeamEchoes, label: Any, seen: Any, by_power: Any) -> Any:
    """Return ranges, brightnesses and labels (3, n) of what is reported."""
    n, row = len(seen), np.arange(len(seen))
    power = np.where(by_power[:, np.newaxis], merged.bright / merged.range_m**2, merged.bright)
    best = np.where(seen, power, -1.0).argmax(axis=1)
    apart = seen & (np.abs(merged.range_m - merged.range_m[row, best][:, np.newaxis]) >= SEPARATION_M)
    far = np.where(apart, merged.range_m, -np.inf)
    last = np.where(far.max(axis=1) > merged.range_m[row, best], far.argmax(axis=1), best)
    second = np.where(apart.any(axis=1), np.where(apart, power, -1.0).argmax(axis=1), best)
    range_m, bright, hit = np.zeros((3, n)), np.zeros((3, n)), np.full((3, n), NOTHING)
    for k, column in enumerate((best, last, np.where(last == best, second, best))):
        ahead = np.abs(echoes.range_m - echoes.range_m[row, column][:, np.newaxis])
        named = label[row, np.where(ahead <= PULSE_M, echoes.bright, -1.0).argmax(axis=1)]
        any_seen = seen.any(axis=1)
        range_m[k] = np.where(any_seen, merged.range_m[row, column], 0.0)
        bright[k] = np.where(any_seen, merged.bright[row, column], 0.0)
        hit[k] = np.where(any_seen, named, NOTHING)
    return range_m, bright, hit


@pytest.mark.parametrize("columns", [5, 7])
def test_pulses_with_several_echoes_report_the_strongest_the_last_and_the_other(columns: int) -> None:
    echoes, rng = drawn(columns)
    n = len(echoes.range_m)
    merged = merge(echoes)
    normal, uniform = rng.standard_normal((2 * n, 4)), rng.random((2 * n, 4))
    limit_m, by_power = LIMIT_M * merged.bright, rng.random(n) < 0.5
    label, at = rng.integers(0, 99, (n, columns)), np.arange(1, 2 * n, 2)
    soft = limit_m * (1.0 + 0.04 * np.clip(normal[at, 3], -3.0, 3.0))[:, np.newaxis]
    seen = (merged.range_m >= 5.2) & (merged.range_m <= soft) & (merged.bright >= FAINTEST)
    seen &= uniform[at, :1] >= DROPOUT
    out = np.full((3, 2 * n), 7.0), np.full((3, 2 * n), 7.0), np.full((3, 2 * n), 7)
    heard = echoes.range_m, echoes.bright, label, merged.range_m, limit_m, merged.bright
    report_several(at, *heard, by_power, SEPARATION_M, normal, uniform, 5.2, DROPOUT, *out)
    for found, expected in zip(out, row_by_row(echoes, merged, label, seen, by_power), strict=True):
        assert (found[:, 0::2] == 7).all()
        assert found[:, 1::2].tolist() == expected.tolist()


def test_returns_are_measured_with_errors_and_with_false_ones_among_them() -> None:
    rng, n = np.random.default_rng(8), 5000
    true_m = np.where(rng.random(n) < 0.2, 0.0, rng.uniform(0.5, 60.0, n))
    last_m = np.where((true_m > 0.0) & (rng.random(n) < 0.3), true_m + 3.0, true_m)
    range_m, bright = np.stack([true_m, last_m, true_m]), rng.random((3, n))
    bright[1:, last_m == true_m] = bright[0, last_m == true_m]
    hit = np.full((3, n), 4)
    normal, uniform, flicker = rng.standard_normal((n, 4)), rng.random((n, 4)), rng.uniform(0.5, 1.5, n)
    row_m, near = rng.normal(0.0, 0.01, n), np.exp(-range_m / 2.0)
    error = normal[:, 2] * np.where(uniform[:, 0] > 1.0 - 0.2, 3.0, 1.0)
    first, last = (np.where(m > 0.0, m + 0.02 * (1.0 + 0.5 * np.exp(-m / 2.0)) * error + row_m, 0.0)
                   for m in (true_m, last_m))  # fmt: skip
    ghost = (true_m > 0.0) & (uniform[:, 1] < 0.1)
    first = np.where(ghost, first * (1.05 + 0.6 * uniform[:, 3]), first)
    nearer = 0.3 + 8.0 * uniform[:, 3] ** 2
    dust = (uniform[:, 1] > 1.0 - 0.1) & ((true_m == 0.0) | (nearer < first))
    expected_m = [np.where(dust, nearer, first), np.where(ghost, first, last), np.where(dust, nearer, first)]
    expected_bright = [bright[0].copy(), np.where(ghost, bright[0], bright[1]),
                       np.where(ghost | dust, bright[0], bright[2])]  # fmt: skip
    expected_hit = np.where(ghost, GHOST, hit)
    expected_hit[::2] = np.where(dust, DUST, expected_hit[::2])
    false = [np.empty(n, np.bool_) for _ in range(3)]
    shares = 0.02, 0.2, 3.0, 0.1, 0.1, 0.7
    measure(near, normal, uniform, flicker, row_m, *shares, range_m, bright, hit, *false)
    np.testing.assert_allclose(range_m, expected_m, rtol=1e-12)
    np.testing.assert_allclose(bright, np.array(expected_bright) * flicker, rtol=1e-12)
    assert hit.tolist() == expected_hit.tolist()
    assert [flags.tolist() for flags in false] == [v.tolist() for v in (ghost, dust, uniform[:, 2] < 0.7)]
