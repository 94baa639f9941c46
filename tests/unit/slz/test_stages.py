"""Stages of the default method: their order, what each needs, and how a new one joins."""

from __future__ import annotations

import re
import threading

import numpy as np
import pytest

import params
from slz import LocalFrame, Window
from slz.frame import MapFrame
from slz.lanes import BESIDE, MAIN, Lanes, unmet
from slz.map_ground import Ground
from slz.stages import BELIEF, GIVEN, METHOD
from slz.window_returns import Flag, Returns
from tests import REPOSITORY

ORDER = [
    ("range_gate", MAIN),
    ("isolation", MAIN),
    ("resolution", MAIN),
    ("registration", MAIN),
    ("seen_air", BESIDE),
    ("raised", MAIN),
    ("surface", BESIDE),
    ("arrivals", MAIN),
    ("wires", MAIN),
    ("far_terrain", BESIDE),
    ("near_terrain", MAIN),
    ("zones", MAIN),
    ("corridors", MAIN),
    ("prior", MAIN),
]
STAGES = (*BELIEF, *METHOD)


def window() -> Window:
    points = np.random.default_rng(1).uniform(-20, 20, (5000, 3)) * (1, 1, 0.001)
    stamps, frame = np.arange(5000, dtype=np.int64), LocalFrame(47.0, 8.0, 400.0)
    return Window(points, stamps, np.array([0.0, 0.0, 20.0]), frame, start_ns=0, end_ns=4999)


class Counting:
    """A stage of a test: one class, and one place in a tuple."""

    name, lane = "counting", MAIN
    reads, sets = frozenset({"KEPT"}), frozenset({"count"})

    def __init__(self) -> None:
        self.count = 0

    def run(self, returns: Returns, _: object, /) -> None:
        self.count = int(((returns.flags & Flag.KEPT) != 0).sum())


class Noting:
    """A stage that notes when it runs and on which thread."""

    def __init__(self, name: str, reads: str, sets: str, lane: int, notes: list[tuple[str, str]]) -> None:
        self.name, self.lane, self.notes = name, lane, notes
        self.reads, self.sets = frozenset(reads), frozenset(sets)

    def run(self, _: object, __: object, /) -> None:
        self.notes.append((self.name, threading.current_thread().name))


def test_the_table_of_stages() -> None:
    assert [(stage.name, stage.lane) for stage in STAGES] == ORDER


def test_no_stage_stands_before_what_it_reads() -> None:
    assert not unmet(STAGES, GIVEN)


def test_a_stage_that_reads_what_only_a_later_one_sets_is_named() -> None:
    early = (METHOD[1], *BELIEF)
    assert unmet(early, GIVEN) == {"registration": frozenset({"KEPT", "NEAR"})}


def test_a_new_stage_is_a_class_and_a_place_in_the_tuple() -> None:
    p, returns, ms, counting = params.load("quadcopter"), Returns.of(window()), dict[str, float](), Counting()
    assert not unmet((*BELIEF, counting), GIVEN)
    Lanes(1).run((*BELIEF, counting), returns, p, ms)
    assert counting.count > 4000
    assert list(ms) == ["range_gate", "isolation", "counting"]


def test_a_window_passes_all_stages_and_each_is_timed() -> None:
    p, returns, ms = params.load("quadcopter"), Returns.of(window()), dict[str, float]()
    lanes = Lanes(2)
    lanes.run(BELIEF, returns, p, ms)
    ground = Ground(MapFrame.of(returns.window.frame, 0), (0.0, 0.0), p, iter(range(1, 100)))
    ground.begin_window(returns.stamp_s, None)
    lanes.run(METHOD, returns, ground, ms)
    assert set(ms) == {name for name, _ in ORDER}
    assert not ground.near.terrain.seen.empty


def test_a_window_itself_is_never_changed() -> None:
    given = window()
    before = given.points_enu_m.copy()
    returns = Returns.of(given)
    returns.places_m += 1
    assert np.array_equal(given.points_enu_m, before)


@pytest.mark.parametrize("threads", [1, 2])
def test_the_first_lane_waits_for_what_it_shares_with_the_second(threads: int) -> None:
    notes: list[tuple[str, str]] = []
    stages = [
        Noting("slow", "p", "a", BESIDE, notes),
        Noting("own", "p", "b", MAIN, notes),
        Noting("reader", "ab", "c", MAIN, notes),
        Noting("last", "p", "d", BESIDE, notes),
    ]
    ms: dict[str, float] = {}
    Lanes(threads).run(stages, None, None, ms)
    names = [name for name, _ in notes]
    assert sorted(names) == ["last", "own", "reader", "slow"]
    assert names.index("slow") < names.index("reader")
    assert set(ms) == set(names)
    main = threading.main_thread().name
    assert {name for name, thread in notes if thread != main} == ({"slow", "last"} if threads == 2 else set())


def test_the_error_of_a_stage_beside_reaches_the_caller() -> None:
    class Failing(Noting):
        def run(self, _: object, __: object, /) -> None:
            raise ArithmeticError(self.name)

    stages = [Failing("bad", "p", "a", BESIDE, []), Noting("own", "p", "b", MAIN, [])]
    with pytest.raises(ArithmeticError, match="bad"):
        Lanes(2).run(stages, None, None, {})


# Existence of the tests that docs/sources.md names.


PAGE = (REPOSITORY / "docs" / "sources.md").read_text("utf-8")
HOME = "tests/unit/slz/test_departures.py"


def test_every_test_named_on_the_page_of_departures_exists() -> None:
    named = re.findall(r"`([\w/.]*)::(test_\w+)`", PAGE)
    assert len(named) > 20
    for file, test in named:
        assert f"def {test}(" in (REPOSITORY / (file or HOME)).read_text("utf-8"), f"{file}::{test}"


def test_every_row_of_departures_names_a_test() -> None:
    dangers = re.findall(r"^\| (\d+) \| (?!`[\w/.]*::)", PAGE, re.MULTILINE)
    tests = re.findall(r"^\| (\d+) \| `[\w/.]*::test_", PAGE, re.MULTILINE)
    assert dangers == tests == [str(row) for row in range(1, len(dangers) + 1)]


def test_every_gap_filled_names_a_test() -> None:
    bullets = PAGE.split("## Gaps and misprints filled")[1].split("\n- ")[1:]
    assert bullets
    assert all("::test_" in bullet for bullet in bullets)
