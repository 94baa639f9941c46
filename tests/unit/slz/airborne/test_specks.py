"""Which returns are specks and which objects: by rays before and after, in dust and without."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from slz import LocalFrame, PointAttributes, ReturnKind, Scan, SpeckDetector, without_specks
from slz.airborne.specks import REACH_M

Floats = NDArray[np.float64]
FRAME = LocalFrame(47.0, 8.0, 400.0)
STEP_NS = 50_000_000
SENSOR = np.array([0.0, 0.0, 10.0])
WALL_M = 15.0


def rays(rng: np.random.Generator, n: int = 3000) -> Floats:
    """Unit vectors (n, 3) within 40 degrees of east."""
    ways = np.column_stack([np.ones(n), rng.uniform(-0.8, 0.8, (n, 2))])
    return np.asarray(ways / np.linalg.norm(ways, axis=1)[:, None])


class View:
    """A LiDAR that looks east at a wall, with dust and things before it."""

    def __init__(self, seed: int = 1, dust: float = 0.0, wire_mm: float = 0.0, box: bool = False) -> None:
        self.rng = np.random.default_rng(seed)
        self.dust, self.wire_m, self.box = dust, wire_mm * 1e-3, box
        self.detector = SpeckDetector()
        self.number = 0

    def scan(self, extra: Floats | None = None, order: NDArray[np.intp] | None = None) -> Scan:
        """Return the next scan; `extra` returns come first, and `dusty` tells which are of dust."""
        ways = rays(self.rng)
        range_m = WALL_M / ways[:, 0]
        self.on_wire = np.zeros(len(ways), bool)
        self.on_box = np.zeros(len(ways), bool)
        if self.wire_m:
            at = ways * (8.0 / ways[:, :1])
            self.on_wire = np.abs(at[:, 2]) < self.wire_m / 2
            range_m = np.where(self.on_wire, 8.0 / ways[:, 0], range_m)
        if self.box:
            at = ways * (6.0 / ways[:, :1])
            self.on_box = (np.abs(at[:, 1:]) < 0.25).all(axis=1)
            range_m = np.where(self.on_box, 6.0 / ways[:, 0], range_m)
        nearer = 0.6 + 7.0 * self.rng.random(len(ways)) ** 2
        self.dusty = (self.rng.random(len(ways)) < self.dust) & (nearer < range_m)
        range_m = np.where(self.dusty, nearer, range_m)
        self.on_wire, self.on_box = self.on_wire & ~self.dusty, self.on_box & ~self.dusty
        points = SENSOR + ways * range_m[:, None]
        if extra is not None:
            points = np.concatenate([extra, points])
        if order is not None:
            points = points[order]
        self.number += 1
        stamps = np.full(len(points), self.number * STEP_NS)
        return Scan(points, stamps, SENSOR, FRAME)

    def look(self, count: int) -> NDArray[np.uint8]:
        for _ in range(count):
            kinds = self.detector.classify(self.scan())
        return kinds


LONE = np.array([[4.0, 0.3, 10.2]])


def test_a_lone_return_is_undecided_and_seen_again_as_soon_as_another_ray_ends_there() -> None:
    view = View()
    kinds = view.detector.classify(view.scan(LONE))
    assert kinds[0] == ReturnKind.UNDECIDED
    assert not is_seen_again(view, LONE)
    beside = LONE + np.array([[0.0, 0.1, 0.0]])
    assert view.detector.classify(view.scan(beside))[0] == ReturnKind.OBJECT
    assert is_seen_again(view, LONE)
    view.look(20)
    assert not is_seen_again(view, LONE), "rays contradict it"


def is_seen_again(view: View, place: Floats) -> bool:
    points, _ = view.detector.seen_again
    return bool((points == place).all(axis=1).any())


def test_a_lone_return_where_nothing_was_before_is_a_speck_at_once() -> None:
    view = View()
    view.look(20)
    assert view.detector.classify(view.scan(LONE))[0] == ReturnKind.SPECK


def test_what_comes_counts_by_its_first_scan() -> None:
    view = View()
    view.look(20)
    view.box = True
    assert (view.look(1)[view.on_box] == ReturnKind.OBJECT).all()
    assert view.on_box.any()


def test_the_wall_is_no_speck() -> None:
    view = View()
    for number in range(10):
        kinds = view.look(1)
        assert (kinds != ReturnKind.SPECK).all()
        assert (kinds == ReturnKind.OBJECT).mean() > (0.9 if number == 0 else 0.99)


@pytest.mark.parametrize("share", [0.001, 0.01, 0.05, 0.2])
def test_dust_is_told_at_four_densities(share: float) -> None:
    view = View(dust=share)
    view.look(20)
    hit = wrong = missed = 0
    for _ in range(20):
        kinds = view.look(1)
        speck = kinds == ReturnKind.SPECK
        hit += int((speck & view.dusty).sum())
        wrong += int((speck & ~view.dusty).sum())
        missed += int((~speck & view.dusty).sum())
    assert 2 * hit / (2 * hit + wrong + missed) > 0.9


@pytest.mark.parametrize("share", [0.0, 0.01, 0.05, 0.2])
def test_a_box_in_dust_is_kept_whole(share: float) -> None:
    view = View(dust=share, box=True)
    for _ in range(30):
        assert (view.look(1)[view.on_box] == ReturnKind.OBJECT).all()


@pytest.mark.parametrize(
    ("share", "diameter_mm"), [(0.0, 10.0), (0.0, 20.0), (0.01, 10.0), (0.01, 20.0), (0.05, 20.0)]
)
def test_a_wire_in_dust_counts_from_its_first_return_on(share: float, diameter_mm: float) -> None:
    view = View(dust=share, wire_mm=diameter_mm)
    last, seen = None, 0
    for number in range(60):
        kinds = view.look(1)
        if not view.on_wire.any() and last is None:
            continue
        seen += 1
        if (kinds[view.on_wire] != ReturnKind.SPECK).any():
            last = number
        assert last is not None, "its first return"
        assert number - last <= 20, "a second: obstacles are remembered for two"
    assert seen > 40


def test_a_wire_that_comes_into_view_late_counts() -> None:
    view = View()
    view.look(40)
    view.wire_m = 0.02
    kept = []
    for _ in range(20):
        kinds = view.look(1)
        kept.append(bool((kinds[view.on_wire] != ReturnKind.SPECK).any()))
    assert all(kept[10:])


def test_specks_before_a_wire_do_not_hide_it_but_a_wall_s_edge_before_it_does_not_count_as_dust() -> None:
    """What is solid before the ball does not tell how dense the air is."""
    view = View(wire_mm=20.0, box=True)
    view.look(20)
    kept = []
    for _ in range(20):
        kinds = view.look(1)
        at = view.on_wire
        kept += list(kinds[at] != ReturnKind.SPECK)
    assert np.mean(kept) > 0.95


def test_the_kinds_do_not_depend_on_the_order_within_a_scan() -> None:
    there, back = View(seed=3, dust=0.05, wire_mm=20.0), View(seed=3, dust=0.05, wire_mm=20.0)
    for _ in range(15):
        order = np.random.default_rng(9).permutation(3000)
        a = there.detector.classify(there.scan())
        b = back.detector.classify(back.scan(order=order))
        assert (a[order] == b).all()


def scans_until_speck(bright: float) -> int:
    """Return how many scans have to pass a place before a return there is a speck at once."""
    for count in range(1, 30):
        view = View()
        view.look(count)
        scan = view.scan(LONE)
        none = np.zeros(len(scan), np.uint8)
        told = PointAttributes.of(np.full(len(scan), bright, np.float32), none, none)
        lit = Scan(scan.points_enu_m, scan.stamp_ns, SENSOR, FRAME, attributes=told)
        if view.detector.classify(lit)[0] == ReturnKind.SPECK:
            return count
    raise AssertionError("never")


def test_a_bright_return_needs_more_to_contradict_it() -> None:
    assert scans_until_speck(0.9) > scans_until_speck(0.05) > 1


def test_rays_without_a_return_contradict_too() -> None:
    told = []
    for known in (True, False):
        rng, detector = np.random.default_rng(2), SpeckDetector()
        far = SENSOR + np.array([[-20.0, 0.0, -10.0]])
        for number in range(1, 21):
            ends = SENSOR + 100 * rays(rng) if known else None
            detector.classify(Scan(far, np.full(1, number * STEP_NS), SENSOR, FRAME, open_enu_m=ends))
        lone = Scan(np.concatenate([LONE, far]), np.full(2, 21 * STEP_NS), SENSOR, FRAME)
        told.append(detector.classify(lone)[0])
    assert told == [ReturnKind.SPECK, ReturnKind.UNDECIDED]


def test_far_returns_are_not_judged() -> None:
    view = View()
    far = SENSOR + np.array([[REACH_M + 1, 0.0, 0.0]])
    assert view.detector.classify(view.scan(far))[0] == ReturnKind.OBJECT


@pytest.mark.parametrize("what", ["forget", "frame", "clock"])
def test_rays_of_before_do_not_count_after_a_jump(what: str) -> None:
    view = View()
    view.look(20)
    frame = FRAME
    if what == "forget":
        view.detector.forget()
    elif what == "frame":
        frame = LocalFrame(47.1, 8.0, 400.0)
    else:
        view.number = 0
    scan = view.scan(LONE)
    kinds = view.detector.classify(Scan(scan.points_enu_m, scan.stamp_ns, SENSOR, frame))
    assert kinds[0] == ReturnKind.UNDECIDED


def test_without_the_sensor_s_place_all_are_objects() -> None:
    scan = Scan(LONE, np.ones(1, np.int64), np.full(3, np.nan), FRAME)
    assert (SpeckDetector().classify(scan) == ReturnKind.OBJECT).all()


def test_specks_are_left_out_and_all_else_stays() -> None:
    kinds = np.array([0, 1, 2], np.uint8)
    points = np.arange(9.0).reshape(3, 3)
    scan = Scan(points, np.arange(3), SENSOR, FRAME, kinds=kinds)
    assert (without_specks(scan).points_enu_m == points[:2]).all()
    plain = Scan(points, np.arange(3), SENSOR, FRAME)
    assert without_specks(plain) is plain
