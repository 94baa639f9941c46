"""Height datum: an estimate whose height slides over ground that stays, and what is no slide."""

from __future__ import annotations

import numpy as np
import pytest

from companion.flight.fusion.height_datum import HeightDatum
from companion.flight.fusion.pose_history import PoseHistory
from params import Parameters
from slz import Scan
from tests.unit.companion.flight.fusion.flights import HOME

SCAN_MS, POINTS, HEIGHT_M, FROM_S = 100, 1500, 8.0, 3.0


class Rig:
    """A vehicle that sinks at 0.5 m/s over rough ground, and its datum."""

    def __init__(self, seed: int = 1, spins: bool = False) -> None:
        self.spins = spins  # a view that turns with time, half a turn a scan
        self.rng = np.random.default_rng(seed)
        self.history = PoseHistory(Parameters(), HOME)
        self.datum = HeightDatum(self.history)
        self.placed: list[Scan] = []

    def slid_m(self, t_s: float, size_m: float) -> float:
        """Return the error of the estimated height: 95 % of a size after three time constants of 0.7 s."""
        return size_m * (1 - np.exp(-(t_s - FROM_S) / 0.7)) if t_s > FROM_S else 0.0

    def pose(self, t_s: float, up_m: float, climb_ms: float, east_m: float = 0.0) -> None:
        lat, lon, alt = HOME.lla(np.array([east_m, 0.0, up_m]))
        self.history.add_attitude(round(t_s * 1e9), (1, 0, 0, 0), (0, 0, 0))
        self.history.add_position(round(t_s * 1e9), float(lat), float(lon), float(alt), (0, 0, -climb_ms))

    def scan(self, t_s: float, size_m: float, object_m: float = 0.0) -> None:
        """Add a scan that ends at a time; an object of some height may fill most of the view."""
        stamps = np.sort(self.rng.uniform(t_s - SCAN_MS * 1e-3, t_s, POINTS))
        places = self.rng.uniform(-15, 15, (POINTS, 2))
        if self.spins:
            way = np.pi * 1e3 / SCAN_MS * (stamps - t_s)
            places = np.linalg.norm(places, axis=1)[:, None] * np.column_stack([np.cos(way), np.sin(way)])
        up = 0.05 * np.sin(places[:, 0]) + self.rng.normal(0, 0.02, POINTS)
        up += np.where(np.hypot(*places.T) < 14, object_m, 0.0)
        up += [self.slid_m(t, size_m) for t in stamps]
        sensor = np.array([0.0, 0.0, HEIGHT_M - 0.5 * t_s + self.slid_m(t_s, size_m)])
        stamp_ns = (stamps * 1e9).astype(np.int64)
        stamp_ns[-1] = round(t_s * 1e9)
        scan = Scan(np.column_stack([places, up]), stamp_ns, sensor, HOME)
        self.datum.add(scan)
        self.placed.append(self.history.correction.scan(scan))

    def fly(
        self, size_m: float, until_s: float = 7.0, object_m: float = 0.0, velocity_share: float = 0.0
    ) -> Rig:
        """Fly; velocity_share: of the slide, that shows in the vertical velocity, too."""
        for t in np.arange(0.0, until_s + 0.01, 0.02):
            ahead_m = self.slid_m(t + 0.01, size_m) - self.slid_m(t - 0.01, size_m)
            up_m = HEIGHT_M - 0.5 * t + self.slid_m(t, size_m)
            self.pose(t, up_m, -0.5 + velocity_share * ahead_m / 0.02)
            if t > 0 and round(t * 1000) % SCAN_MS == 0:
                self.scan(t, size_m, object_m if t > FROM_S else 0.0)
        return self

    @property
    def shift_m(self) -> float:
        return float(self.history.correction.shift_enu_m[2])


@pytest.mark.parametrize("size_m", [3.0, -3.0, 0.8])
@pytest.mark.parametrize("velocity_share", [0.0, 0.3])
@pytest.mark.parametrize("spins", [False, True])
def test_an_estimate_that_slides_moves_nothing_on_the_map(
    size_m: float, velocity_share: float, spins: bool
) -> None:
    """Neither within a scan, nor from one to the next: 0.15 m would be a step that no gear stands on."""
    rig = Rig(spins=spins).fly(size_m, velocity_share=velocity_share)
    assert rig.shift_m == pytest.approx(-size_m, abs=0.12)
    heights = np.array([np.median(scan.points_enu_m[:, 2]) for scan in rig.placed])
    assert np.abs(heights).max() < 0.06
    within = [scan.points_enu_m[-500:, 2].mean() - scan.points_enu_m[:500, 2].mean() for scan in rig.placed]
    assert np.max(np.abs(within)) < 0.05
    pose = rig.history.latest(round(7.0e9))
    assert pose is not None
    assert pose.position_enu_m[2] == pytest.approx(HEIGHT_M - 3.5, abs=0.15)


def test_a_flight_without_a_slide_is_left_as_it_is() -> None:
    rig = Rig().fly(0.0)
    assert rig.history.correction.is_none


def test_the_sway_of_a_filter_is_no_slide() -> None:
    """A tenth of a metre stays with the registration of the window."""
    assert Rig().fly(0.08).history.correction.is_none


def test_an_object_that_fills_the_view_is_not_the_ground() -> None:
    """Its velocity agrees with the height that the autopilot estimates."""
    assert Rig().fly(0.0, object_m=1.5).history.correction.is_none


def test_a_picture_that_goes_with_the_vehicle_is_no_slide() -> None:
    """A sensor that repeats what it saw shows ground that sinks with the vehicle, as its velocity says."""
    rig = Rig()
    for t in np.arange(0.0, 6.0, 0.02):
        rig.pose(t, HEIGHT_M - 0.5 * t, -0.5)
        if t > 0 and round(t * 1000) % SCAN_MS == 0:
            scan = Scan(
                np.column_stack([rig.rng.uniform(-15, 15, (POINTS, 2)), np.full(POINTS, -0.5 * t)]),
                np.full(POINTS, round(t * 1e9)),
                np.array([0.0, 0.0, HEIGHT_M - 0.5 * t]),
                HOME,
            )
            rig.datum.add(scan)
    assert rig.history.correction.is_none


def test_a_narrow_view_tells_no_datum() -> None:
    rig = Rig()
    rig.rng = _Narrow(rig.rng)  # type: ignore[assignment]
    assert rig.fly(3.0).history.correction.is_none


class _Narrow:
    """Random places within a metre."""

    def __init__(self, rng: np.random.Generator) -> None:
        self._rng = rng

    def uniform(self, low: float, high: float, size: int | tuple[int, int]) -> np.ndarray:
        drawn = self._rng.uniform(low, high, size)
        return drawn / 15 if isinstance(size, tuple) else drawn

    def normal(self, *args: float) -> np.ndarray:
        return self._rng.normal(*args)


def test_a_slide_that_nobody_sees_is_not_extrapolated() -> None:
    """The shift stays as it was last seen, and the ground seen afterwards is the new reference."""
    rig = Rig().fly(3.0, until_s=3.5)
    seen_m = rig.shift_m
    assert seen_m == pytest.approx(-rig.slid_m(3.5, 3.0), abs=0.12)
    for t in np.arange(3.52, 7.01, 0.02):
        rig.pose(t, HEIGHT_M - 0.5 * t + rig.slid_m(t, 3.0), -0.5)
    rig.scan(7.0, 3.0)
    assert rig.shift_m == seen_m


def test_a_jump_that_begins_an_epoch_begins_the_datum_anew() -> None:
    rig = Rig().fly(3.0)
    rig.pose(7.02, HEIGHT_M - 0.5, -0.5, east_m=40.0)
    assert rig.history.epoch == 1
    rig.scan(7.1, 3.0)
    assert rig.history.correction.is_none


class _Wandering(Rig):
    """An estimate whose height wanders by decimetres that its velocity does not know, as PX4's in SIH."""

    def slid_m(self, t_s: float, size_m: float) -> float:
        return super().slid_m(t_s, size_m) + 0.12 * float(np.sin(2.0 * t_s) + np.sin(0.9 * t_s))


def test_an_estimate_that_wanders_all_the_time_is_followed_by_the_map_alone() -> None:
    assert _Wandering().fly(0.0, until_s=14.0).shift_m == pytest.approx(0.0, abs=0.05)


class _Absorbing(Rig):
    """An estimator that takes more and more of a slow slide for a velocity, as EKF3 does."""

    def slid_m(self, t_s: float, size_m: float) -> float:
        return size_m * (1 - np.exp(-(t_s - FROM_S) / 3.0)) if t_s > FROM_S else 0.0

    def pose(self, t_s: float, up_m: float, climb_ms: float, east_m: float = 0.0) -> None:
        sliding_ms = (self.slid_m(t_s + 0.01, 3.0) - self.slid_m(t_s - 0.01, 3.0)) / 0.02
        share = min(0.7, max(0.0, 0.2 * (t_s - FROM_S)))
        super().pose(t_s, up_m, climb_ms + share * sliding_ms, east_m)


def test_a_slide_is_followed_to_its_end_though_the_velocity_explains_more_and_more_of_it() -> None:
    rig = _Absorbing().fly(3.0, until_s=12.0)
    assert rig.shift_m == pytest.approx(-rig.slid_m(12.0, 3.0), abs=0.1)


def _touch_down(over_ground_m: float) -> Rig:
    """Stop at a height over the ground, 0.2 m late by the velocity; from then on the ground flickers."""
    rig = Rig()
    for t in np.arange(0.0, 7.01, 0.02):
        up_m = over_ground_m + max(0.0, 1.5 - 0.5 * t)
        rig.pose(t, up_m, -0.5 if t < 3.4 else 0.0)
        number = round(t * 1000) // SCAN_MS
        if t > 0 and round(t * 1000) % SCAN_MS == 0:
            over_m = rig.rng.normal(0, 0.02, POINTS) + (0.15 if t > 3.0 and number % 4 < 2 else 0.0)
            places = rig.rng.uniform(-15, 15, (POINTS, 2))
            stamp_ns = np.linspace(t - SCAN_MS * 1e-3, t, POINTS) * 1e9
            scan = Scan(
                np.column_stack([places, over_m]), stamp_ns.astype(np.int64), np.array([0, 0, up_m]), HOME
            )
            rig.datum.add(scan)
            rig.placed.append(rig.history.correction.scan(scan))
    return rig


def test_a_ground_that_flickers_is_never_followed_by_more_than_it_moves() -> None:
    """Slides that ended with the scan after they had begun were answered by shifts of up to 4.4 m."""
    heights = np.array([np.median(scan.points_enu_m[:, 2]) for scan in _touch_down(2.0).placed])
    assert np.abs(heights).max() < 0.35


def test_a_vehicle_that_stands_has_no_datum() -> None:
    """Rays graze the ground: an error of the attitude is decimetres of height."""
    assert _touch_down(0.03).history.correction.is_none
