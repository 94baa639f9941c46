"""Ranges from waveforms: against the truth, the Cramér-Rao bound and SciPy."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import curve_fit

from slz.flash.camera import FlashCamera, FlashFrame
from slz.flash.frame_processing import process_frame
from slz.flash.ranging import likely_ranges, polynomial_map, polynomial_ranges, range_bound_m
from slz.kernels.instruments.waveform import GOOD, MISSING, ODD, SATURATED
from tests.unit.slz.flash.waveforms import frame_of, noisy_camera, some_peaks

LEVELS = (0.05, 0.1, 0.2, 0.3)
SOURCE_CM = ((2.2, 1.5), (3.3, 2.6), (6.9, 4.8), (9.9, 8.1))  # Flash Table 1
PART_OF_NORMAL = (2 / np.pi) ** 0.5  # mean of the absolute value of a standard normal number


def small(share: float = 0.05, **more: object) -> FlashCamera:
    return noisy_camera(share, rows=32, cols=32, **more)


def test_ranges_without_noise_are_exact_for_the_pulse_and_nearly_so_for_the_polynomial() -> None:
    camera = small(0.0)
    frame, true = frame_of(camera, some_peaks(camera), 1500.0, 0.0)
    assert np.abs(likely_ranges(frame, camera).range_m - true).max() < 2e-3  # counts are whole numbers
    # A polynomial of 6th degree is no Gaussian: its maximum lies up to 3 cm off within a sample.
    assert np.abs(polynomial_ranges(frame, camera).range_m - true).max() < 0.05


@pytest.mark.parametrize("share", LEVELS)
def test_likeliest_range_is_within_a_tenth_of_the_cramer_rao_bound(share: float) -> None:
    camera = noisy_camera(share)
    frame, true = frame_of(camera, some_peaks(camera), 1500.0, share)
    image = likely_ranges(frame, camera)
    good = image.state == GOOD
    assert good.mean() > 0.97
    error = (image.range_m - true)[good]
    bound = range_bound_m(camera, share)
    assert np.median(np.abs(error)) / 0.6745 == pytest.approx(bound, rel=0.1)
    assert np.nanmedian(image.sigma_m) == pytest.approx(bound, rel=0.1)


@pytest.mark.parametrize(("share", "source_cm"), list(zip(LEVELS, SOURCE_CM, strict=True)))
def test_image_filtered_as_in_the_source_beats_its_table(
    share: float, source_cm: tuple[float, float]
) -> None:
    """The range of a pixel of the image: polynomial, then the 9-point median; likewise by likelihood."""
    camera = noisy_camera(share)
    ramp = np.broadcast_to(np.linspace(8.5, 9.5, camera.cols), (camera.rows, camera.cols))
    frame, true = frame_of(camera, ramp, 1500.0, share)
    cells = {}
    for estimator in ("polynomial", "likely"):
        error = process_frame(frame, camera, estimator).filtered_m - true  # type: ignore[arg-type]
        size = 100 * np.abs(error[np.isfinite(error)])
        cells[estimator] = (size.mean(), size.std())
    assert cells["polynomial"][0] <= source_cm[0]
    assert cells["polynomial"][1] <= source_cm[1]
    assert cells["likely"][0] <= 0.6 * source_cm[0]
    assert cells["likely"][1] <= 0.6 * source_cm[1]


def test_bound_of_a_single_waveform_lies_above_what_the_source_prints_from_ten_percent_on() -> None:
    """So no unbiased estimator of a pulse of 10 ns can print Flash Table 1: see docs/instruments.md."""
    camera = FlashCamera()
    for share, (mean_cm, _) in tuple(zip(LEVELS, SOURCE_CM, strict=True))[1:]:
        assert 100 * range_bound_m(camera, share) * PART_OF_NORMAL > mean_cm


def test_polynomial_is_numpys_least_squares_fit() -> None:
    rng = np.random.default_rng(3)
    y = rng.normal(size=19)
    ours = polynomial_map(19) @ y
    theirs = np.polynomial.polynomial.polyfit(np.linspace(-1, 1, 19), y, 6)
    assert np.allclose(ours, theirs)


def test_a_range_is_where_numpy_s_polynomial_is_greatest_wherever_in_the_buffer() -> None:
    camera = small(0.03)
    frame, _ = frame_of(camera, some_peaks(camera, spread=5.0), 1500.0, 0.03)
    image = polynomial_ranges(frame, camera)
    u = np.linspace(-1, 1, 18_001)
    inner = (u >= 3 / 9 - 1) & (u <= 1 - 3 / 9)  # not the three outermost samples
    for row, col in np.ndindex(8, 8):
        ring = frame.samples[row, col]
        y = np.roll(ring, -int(np.argmin(ring)) - 1)[:-1] - camera.baseline_counts
        fit = np.polynomial.polynomial.polyval(
            u, np.polynomial.polynomial.polyfit(np.linspace(-1, 1, 19), y, 6)
        )
        best = u[inner][np.argmax(fit[inner])]
        if abs(best) < 0.6:  # a maximum, not the end of where it is looked for
            assert image.range_m[row, col] == pytest.approx(
                (700 - 19 + 9 + 9 * best) * camera.sample_m, abs=1e-3
            )
            assert image.intensity[row, col] == pytest.approx(fit[inner].max(), rel=1e-6)
            assert image.state[row, col] == GOOD


@pytest.mark.parametrize(("clipped", "state"), [(4, GOOD), (5, SATURATED)])
def test_four_clipped_samples_leave_a_range_and_five_do_not(clipped: int, state: int) -> None:
    camera = small(0.001)
    frame, _ = frame_of(camera, np.full((32, 32), 9.2), 1500.0, 0.0)
    order = np.sort(frame.samples[0, 0])
    cut = noisy_camera(0.001, rows=32, cols=32, saturated_counts=int(order[-clipped]))
    samples = np.minimum(frame.samples, cut.saturated_counts)
    for ranges in (likely_ranges, polynomial_ranges):
        assert (ranges(FlashFrame(samples, frame.counter), cut).state == state).all()


def test_likeliest_pulse_is_that_of_scipys_least_squares() -> None:
    camera = small(0.1)
    frame, _ = frame_of(camera, some_peaks(camera), 1500.0, 0.1)
    image = likely_ranges(frame, camera)
    k = np.arange(19)
    for row, col in ((0, 0), (5, 9), (31, 31)):
        ring = frame.samples[row, col]
        y = np.roll(ring, -int(np.argmin(ring)) - 1)[:-1] - camera.baseline_counts

        def pulse(x: np.ndarray, t: float, a: float) -> np.ndarray:
            return np.asarray(a * np.exp(-0.5 * ((x - t) / camera.pulse_sigma_samples) ** 2))

        (t, a), _ = curve_fit(pulse, k, y, (9.0, 1500.0))
        assert image.range_m[row, col] == pytest.approx((700 - 19 + t) * camera.sample_m, abs=1e-4)
        assert image.intensity[row, col] == pytest.approx(a, rel=1e-4)


def test_clipped_samples_are_left_out_and_a_lost_pulse_is_saturated() -> None:
    camera = small(0.01, saturated_counts=9_100)
    frame, true = frame_of(camera, some_peaks(camera), 1500.0, 0.01)
    image = likely_ranges(frame, camera)
    assert (image.state == GOOD).all()
    assert np.abs(image.range_m - true).max() < 0.05
    strong, _ = frame_of(camera, some_peaks(camera), 15_000.0, 0.001)
    assert (likely_ranges(strong, camera).state == SATURATED).all()
    assert np.isnan(likely_ranges(strong, camera).range_m).all()


def test_two_echoes_in_one_pixel_are_no_range() -> None:
    camera = small(0.02)
    peaks = some_peaks(camera)
    near, _ = frame_of(camera, peaks - 3.0, 1500.0, 0.02)
    far, _ = frame_of(camera, peaks + 3.5, 1500.0, 0.02, seed=1)
    both = near.samples.astype(int) + far.samples - round(camera.baseline_counts)
    mixed = FlashFrame(np.clip(both, 0, 65_000).astype(np.uint16), near.counter)
    image = likely_ranges(mixed, camera)
    assert (image.state == ODD).mean() > 0.99
    assert np.isnan(image.range_m[image.state == ODD]).all()


def test_ring_without_an_end_marker_or_with_two_gives_nothing() -> None:
    camera = small()
    frame, _ = frame_of(camera, some_peaks(camera), 1500.0, 0.05)
    samples = frame.samples.copy()
    samples[0, 0] = np.maximum(samples[0, 0], 7000)
    samples[0, 1, :2] = 0
    samples[0, 1, 5] = 0
    for ranges in (likely_ranges, polynomial_ranges):
        image = ranges(FlashFrame(samples, frame.counter), camera)
        assert image.state[0, :2].tolist() == [MISSING, MISSING]
        assert np.isnan(image.range_m[0, :2]).all()


def test_pixel_never_triggered_or_noise_alone_gives_nothing() -> None:
    camera = small(0.05)
    frame, _ = frame_of(camera, some_peaks(camera), 1e-3, 0.05)
    dark = FlashFrame(frame.samples, frame.counter)
    assert np.isnan(likely_ranges(dark, camera).range_m).all()
    lit, _ = frame_of(camera, some_peaks(camera), 1500.0, 0.05)
    gate = np.full_like(lit.counter, camera.gate_counter)
    assert np.isnan(polynomial_ranges(FlashFrame(lit.samples, gate), camera).range_m).all()


def test_frame_of_another_size_or_type_is_refused_by_name() -> None:
    camera = small()
    frame, _ = frame_of(camera, some_peaks(camera), 1500.0, 0.05)
    with pytest.raises(ValueError, match=r"\(16, 32, 20\).*camera has \(32, 32, 20\)"):
        likely_ranges(FlashFrame(frame.samples[:16], frame.counter[:16]), camera)
    with pytest.raises(ValueError, match="uint16"):
        FlashFrame(frame.samples.astype(np.int32), frame.counter)  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="pulse_fwhm_ns"):
        FlashCamera(pulse_fwhm_ns=0.0)
