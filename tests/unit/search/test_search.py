"""Rare-event search without a flight: scenarios, hunt, shrinking, counts."""

from __future__ import annotations

import json
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from companion.desk.evidence.artefact_fields import Fields
from companion.desk.evidence.landing_counts import read_counts
from companion.runtime.program_version import program_version
from tests.search import counts
from tests.search.__main__ import main
from tests.search.equality import figures
from tests.search.flight import COARSE, DETAILS, SAFE, TAKEN, UNSAFE, Outcome, end_of
from tests.search.flights import Flier
from tests.search.flown_file import InputError
from tests.search.hunt import GENERATION, Hunt
from tests.search.niche_search import FIRST, next_generation
from tests.search.scenario import (
    DEFAULTS,
    FAULTS,
    SPACE,
    Range,
    Scenario,
    acting,
    one_trouble,
    read,
    telling,
    uniform,
)
from tests.search.scored import Scored
from tests.search.shrink import shrink
from tests.search.surprise import surprises
from tests.search.weaknesses import WEAKNESSES, turn_deg

PEAK = {"wind_ms": 6.0, "wind_from_deg": 350.0, "hazard_height_m": 1.1, "hazard_below_m": 4.4}


def outcome(margin: float, end: str = "") -> Outcome:
    end = end or ("unsafe" if margin < 0 else "safe")
    return Outcome(end, margin, margin, {"hazard": margin}, {}, [], None, 20.0, 1.0)


def narrow(scenario: Scenario) -> Outcome:
    """Return the outcome by the distance from a peak in four parameters, unsafe in 0.02 % of the space."""
    if scenario.text("hazard") != "box":
        return outcome(1.0)
    share = 1.0
    for name, peak in PEAK.items():
        part = SPACE[name]
        assert isinstance(part, Range)
        span = part.high - part.low
        off = abs(scenario.number(name) - peak)
        off = min(off, span - off) if name.endswith("_deg") else off
        share *= max(0.0, 1.0 - off / (0.6 * span))
    return outcome(0.7 - share)


def flier(outcome_of: Callable[[Scenario], Outcome] = narrow, detail: str = COARSE) -> Flier:
    return Flier(detail, None, lambda scenario, _, weakness: outcome_of(scenario))


def test_a_scenario_names_its_parameters() -> None:
    assert Scenario.of().changed() == {}
    assert Scenario.of(wind_ms=3.0).changed() == {"wind_ms": 3.0}
    with pytest.raises(ValueError, match="no parameter 'wind'"):
        Scenario.of(wind=3.0)
    for name, value in (("wind_ms", 9.0), ("wind_ms", "3"), ("hazard", "cube"), ("late_s", float("nan"))):
        with pytest.raises(ValueError, match=name):
            Scenario.of(**{name: value})


def test_even_draws_are_inside_and_repeat() -> None:
    drawn = [uniform(np.random.default_rng(number)) for number in range(50)]
    assert all(Scenario.of(**one.values) == one for one in drawn)
    assert drawn == [uniform(np.random.default_rng(number)) for number in range(50)]
    assert {one.text("fault") for one in drawn} > {"none", "lidar_stop"}


def test_of_fault_and_hazard_at_most_one_comes_and_each_comes_often() -> None:
    drawn = [one_trouble(np.random.default_rng(number)) for number in range(200)]
    faulty, met = ([one.text(name) != "none" for one in drawn] for name in ("fault", "hazard"))
    assert not any(f and m for f, m in zip(faulty, met, strict=True))
    assert sum(faulty) > 60
    assert sum(met) > 60


def test_a_file_holds_what_is_not_at_its_default(tmp_path: Path) -> None:
    path = tmp_path / "one.json"
    path.write_text(json.dumps({"scenario": {"wind_ms": 3.0}, "weakness": None}))
    assert read(path) == Scenario.of(wind_ms=3.0)


def test_the_search_finds_what_even_draws_miss(tmp_path: Path) -> None:
    rng = np.random.default_rng(7)
    assert not any(narrow(uniform(rng)).unsafe for _ in range(2000))
    for seed in range(3):
        hunt = Hunt(tmp_path / f"{seed}.jsonl", flier(), seed)
        assert len(hunt.run(800)) == 1
        assert narrow(hunt.failures[0]).unsafe


def test_a_hunt_goes_past_failures_that_are_not_what_is_hunted(tmp_path: Path) -> None:
    path = tmp_path / "hunt.jsonl"
    strict = Hunt(path, flier(), 1, confirm=lambda scenario: scenario.number("wind_ms") > 6.0)
    (found,) = strict.run(2000)
    others = [one for one in strict.flown if one["margin"] < 0.0 and not one["failure"]]
    assert found.number("wind_ms") > 6.0
    assert all(one["scenario"]["wind_ms"] <= 6.0 for one in others)
    assert Hunt(path, flier(), 1).failures == [found]


def test_a_hunt_goes_on_where_it_was_stopped(tmp_path: Path) -> None:
    whole, parts = (Hunt(tmp_path / name, flier(), 1) for name in ("whole.jsonl", "parts.jsonl"))
    whole.run(3 * GENERATION + 5, failures=9)
    parts.run(GENERATION + 7, failures=9)
    with (tmp_path / "parts.jsonl").open("a") as file:
        file.write('{"scenario": {"wi')  # the computer went off
    again = Hunt(tmp_path / "parts.jsonl", flier(), 1)
    again.run(3 * GENERATION + 5, failures=9)
    assert again.flown == whole.flown


def test_failures_and_failsafes_are_no_examples(tmp_path: Path) -> None:
    ends = iter([outcome(-0.5), outcome(-0.4, "failsafe"), *(outcome(0.5 + 0.01 * n) for n in range(100))])
    hunt = Hunt(tmp_path / "hunt.jsonl", flier(lambda _: next(ends)), 1)
    assert len(hunt.run(70, failures=2)) == 1
    assert len(hunt.flown) == 70
    scenarios = [Scenario.of(**one["scenario"]) for one in hunt.flown]
    learnt = [
        Scored(one["score"], one["score"], 1.0, {}, "safe []", s)
        for one, s in zip(hunt.flown[2:60], scenarios[2:60], strict=True)
    ]
    drawn = next_generation(np.random.default_rng([1, 3]), learnt, GENERATION)
    assert len(learnt) > FIRST
    assert scenarios[60:70] == drawn[:10]


def test_flights_without_a_fault_are_varied_as_often_as_all_others() -> None:
    rng = np.random.default_rng(4)
    flown = [
        Scored(0.5, 0.5, 1.0, {}, "aborted []", uniform(rng).replaced("fault", fault))
        for fault in FAULTS
        for _ in range(4)
    ]
    drawn = next_generation(rng, flown, 600)
    plain = sum(scenario.values["fault"] == "none" for scenario in drawn)
    assert 0.38 < plain / len(drawn) < 0.55


def test_half_of_the_variations_put_a_hazard_where_the_vehicle_came_down_beside_the_point() -> None:
    calm = Scenario.of(hazard_aside_m=0.5, hazard_aside_deg=300.0)
    for missed_m, low, high in ((2.5, 0.25, 0.4), (0.5, 0.0, 0.1)):
        flown = [
            Scored(0.5, 0.5, 0.5, {"accuracy": -4.0}, "safe ['accuracy']", calm, (missed_m, 80.0))
        ] * FIRST
        drawn = next_generation(np.random.default_rng(2), flown, 400)
        met = [
            one.text("hazard") != "none"
            and abs(one.number("hazard_aside_m") - missed_m) < 1.0
            and abs(turn_deg(one.number("hazard_aside_deg"), 80.0)) < 60.0
            for one in drawn
        ]
        assert low <= sum(met) / len(met) < high


def test_the_most_surprising_flights_are_varied_often_among_many_niches() -> None:
    rng = np.random.default_rng(6)
    flown = [Scored(0.5, 0.5, 1.0, {"reaction": 0.0}, f"end {n}", uniform(rng)) for n in range(200)]
    flown += [Scored(0.9, 0.9, 1.0, {"accuracy": -5.0}, "aborted []", uniform(rng)) for _ in range(2)]
    kept_by = [{one.scenario.values[n] for n in ("gust_ms", "drift_ms")} for one in flown[-2:]]
    drawn = next_generation(rng, flown, 600)
    varied = sum(bool(kept & set(one.values.values())) for one in drawn for kept in kept_by)
    assert varied > 60


def test_a_family_comes_less_often_the_more_of_it_were_flown() -> None:
    rng = np.random.default_rng(8)
    most, next_one = (uniform(rng).replaced("fault", "none").replaced("hazard", "box") for _ in range(2))
    seen = []
    for copies in (1, 160):
        flown = [Scored(0.9, 0.9, 1.0, {"reaction": -5.0}, "aborted []", most) for _ in range(copies)]
        flown += [Scored(0.9, 0.9, 1.0, {"reaction": -4.0}, "aborted []", next_one)]
        plain = [uniform(rng).replaced("fault", "none") for _ in range(40)]
        flown += [Scored(0.9, 0.9, 1.0, {}, "aborted []", one) for one in plain]
        drawn = next_generation(rng, flown, 400)
        seen.append(
            [sum(one.values["gust_ms"] == of.values["gust_ms"] for one in drawn) for of in (most, next_one)]
        )
    assert seen[0][0] > seen[0][1] > 40
    assert seen[1][1] > seen[1][0] > 40


def test_of_a_family_the_most_surprising_and_the_nearest_of_the_surprising_are_varied() -> None:
    rng = np.random.default_rng(9)
    first = uniform(rng).replaced("fault", "none").replaced("hazard", "box")
    family = [first, *(first.replaced("gust_ms", gust) for gust in (0.1111, 0.2222))]
    flown = [
        Scored(0.5, margin, 1.0, {"reaction": surprise}, "aborted []", one)
        for one, margin, surprise in zip(family, (0.9, 0.1, 0.05), (-8.0, -5.0, -3.0), strict=True)
    ]
    plain = [uniform(rng).replaced("fault", "none") for _ in range(FIRST)]
    flown += [Scored(0.0, 0.0, 1.0, {}, "aborted []", one) for one in plain]
    drawn = next_generation(rng, flown, 400)
    most, nearest, other = (
        sum(one.values["gust_ms"] == of.values["gust_ms"] for one in drawn) for of in family
    )
    assert min(most, nearest) > 60
    assert other < 20


def test_the_most_surprising_of_a_family_is_crossed_with_the_nearest() -> None:
    rng = np.random.default_rng(11)
    most = uniform(rng).replaced("fault", "none").replaced("hazard", "box")
    other = {"wind_ms": 1.1111, "hazard_below_m": 4.1111, "gust_ms": 0.1111, "drift_ms": 0.0111}
    nearest = Scenario({**most.values, **other})
    flown = [Scored(0.5, 0.5, 0.1, {"reaction": -9.0}, "aborted []", most)]
    flown += [Scored(0.6, 0.1, 0.3, {"reaction": -6.0}, "aborted []", nearest)]
    flown += [Scored(0.9, 0.9, 1.0, {}, "aborted []", uniform(rng)) for _ in range(FIRST)]
    drawn = next_generation(rng, flown, 1000)
    taken = [sum(one.values[name] == value for name, value in other.items()) for one in drawn]
    assert min(taken.count(n) for n in range(1, 4)) > 25


def test_some_variations_of_two_troubles_leave_one_out() -> None:
    rng = np.random.default_rng(10)
    both = uniform(rng).replaced("fault", "lidar_half").replaced("hazard", "box")
    flown = [Scored(0.5, 0.5, 1.0, {"reaction": -9.0}, "aborted []", both)]
    flown += [Scored(0.9, 0.9, 1.0, {}, "aborted []", uniform(rng)) for _ in range(FIRST)]
    drawn = [
        one
        for one in next_generation(rng, flown, 1000)
        if sum(one.values[name] == both.values[name] for name in SPACE) >= len(SPACE) - 3
    ]
    spared = [name for one in drawn for name in ("fault", "hazard") if one.text(name) == "none"]
    assert 0.08 < len(spared) / len(drawn) < 0.22
    assert min(spared.count("fault"), spared.count("hazard")) > 20


def test_what_tells_nothing_is_drawn_seldom() -> None:
    rng = np.random.default_rng(3)
    drawn = [telling(rng) for _ in range(1000)]
    kinds = [(one.values["fault"], one.values["hazard"] == "none") for one in drawn]
    assert 150 < kinds.count(("none", True)) < 210
    assert 280 < kinds.count(("none", False)) < 370
    assert 150 < sum(fault == "lidar_stop" for fault, _ in kinds) < 220
    assert sum(one.number("hazard_aside_m") < 1.0 for one in drawn) > 450


def test_what_is_known_to_be_late_is_no_surprise() -> None:
    rng = np.random.default_rng(5)
    drawn = [uniform(rng) for _ in range(300)]
    weak = [turn_deg(one.number("wind_from_deg"), 315.0) ** 2 < 15.0**2 for one in drawn]
    answered = [
        {"reaction": 0.9 - one.number("link_delay_s") - 0.4 * (one.text("hazard") == "post") - 0.3 * late}
        for one, late in zip(drawn, weak, strict=True)
    ]
    found = [one["reaction"] for one in surprises(drawn, answered)]
    assert max(f for f, late in zip(found, weak, strict=True) if late) < -1.0
    assert min(f for f, late in zip(found, weak, strict=True) if not late) > -1.0
    copies = [drawn[weak.index(True)]] * 300
    again = surprises(drawn + copies, answered + [answered[weak.index(True)]] * 300)
    assert again[-1]["reaction"] < -1.0
    assert surprises(drawn[:2], [{}, {"accuracy": 0.3}]) == [{}, {"accuracy": 0.0}]


def fails_by_wind_and_box(scenario: Scenario) -> bool:
    return scenario.number("wind_ms") > 3.0 and scenario.text("hazard") == "box"


def test_a_failure_shrinks_to_what_it_takes() -> None:
    start = uniform(np.random.default_rng(3)).replaced("wind_ms", 8.0).replaced("hazard", "box")
    minimal = shrink(start, fails_by_wind_and_box)
    assert set(minimal.changed()) == {"wind_ms", "hazard"}
    assert 3.0 < minimal.number("wind_ms") <= 4.0


def test_shrinking_keeps_to_its_flights_and_never_loses_the_failure() -> None:
    flown: list[Scenario] = []

    def fails(scenario: Scenario) -> bool:
        flown.append(scenario)
        return fails_by_wind_and_box(scenario)

    start = Scenario({**uniform(np.random.default_rng(4)).values, "wind_ms": 8.0, "hazard": "box"})
    minimal = shrink(start, fails, most=5)
    assert len(flown) == 5
    assert fails_by_wind_and_box(minimal)


def counted(path: Path, landings: int) -> dict[str, object]:
    found = counts.count(path, landings, flier())
    return {name: value for name, value in found.items() if name != "updated"}


def test_counts_go_on_where_they_were_stopped(tmp_path: Path) -> None:
    counted(tmp_path / "parts.json", 13)
    assert counted(tmp_path / "parts.json", 25) == counted(tmp_path / "whole.json", 25)
    kept = json.loads((tmp_path / "whole.json").read_text())
    assert kept["landings"] == 25
    assert kept["ends"]["safe"] == 25
    assert sum(row["safe"] for row in kept["by_hazard"].values()) == 25


def test_an_unsafe_landing_is_counted_with_its_scenario(tmp_path: Path) -> None:
    found = counts.count(tmp_path / "counts.json", 3, flier(lambda _: outcome(-0.2)))
    assert found["ends"]["unsafe"] == 3
    assert found["least_margin"] == -0.2
    assert [one["number"] for one in found["unsafe"]] == [0, 1, 2]
    assert Scenario.of(**found["unsafe"][1]["scenario"]) == counts.numbered(1, 1)


def test_outcomes_are_equal_if_both_or_neither_landed_and_both_are_as_safe() -> None:
    def flown(number: int, cheap: str, full: str, margins: tuple[float, float]) -> dict[str, object]:
        both = {"cheap": (cheap, margins[0]), "full": (full, margins[1])}
        return {"number": number} | {
            how: {
                "end": end,
                "margin": margin,
                "touchdown": {} if end == "refused" else {"e": 0.0},
                "cpu_s": 1.0,
            }
            for how, (end, margin) in both.items()
        }

    found = figures(
        [
            flown(0, "safe", "safe", (0.3, 0.2)),
            flown(1, "aborted", "refused", (0.5, 1.0)),
            flown(2, "unsafe", "safe", (-0.3, 0.2)),
        ]
    )
    assert (found["equal"], found["same_end"], found["same_safety"]) == (2, 1, 2)
    assert found["unequal"] == [2]
    assert found["margin_off"]["p100"] == 0.5


def test_the_default_scenario_is_one_in_which_nothing_happens() -> None:
    quiet = {name for name, value in DEFAULTS.items() if value in (0.0, "none")}
    assert {
        "wind_ms",
        "gust_ms",
        "drift_ms",
        "dust_below_m",
        "link_delay_s",
        "late_s",
        "fault",
        "hazard",
    } <= quiet


def test_counts_are_evidence_of_this_version_and_go_on_with_no_other(tmp_path: Path) -> None:
    path = tmp_path / "counts.json"
    document = counts.evidence(counts.count(path, 4, flier(lambda _: outcome(0.3))))
    (flights, *_) = read_counts(Fields("counts.json", document))
    assert (flights.runs, flights.unsafe) == (4, 0)
    assert (document["program"], document["safe"]) == (program_version(), 4)
    path.write_text(path.read_text().replace(program_version(), "0.1.0+0"))
    with pytest.raises(ValueError, match="another version"):
        counts.count(path, 5, flier(lambda _: outcome(0.3)))


def test_only_parameters_that_act_are_changed() -> None:
    nothing = acting(Scenario.of())
    assert {"fault", "hazard", "wind_ms"} <= set(nothing)
    assert not [name for name in nothing if name.startswith(("fault_", "hazard_"))]
    post = acting(Scenario.of(fault="lidar_stop", hazard="post"))
    assert set(SPACE) - set(post) == {"hazard_size_m"}
    assert acting(Scenario.of(fault="lidar_stop", hazard="box")) == list(SPACE)


@pytest.mark.parametrize(
    ("change", "seed", "told"),
    [
        (lambda text: text.replace(program_version(), "0.1.0+0"), 1, "another version"),
        (lambda text: text, 2, "another search"),
        (lambda text: text.replace('"lidar_ms": ', '"lidar_ms": 9'), 1, "another search"),
        (lambda text: text[text.index("\n") + 1 :], 1, "another search"),
        (lambda text: text.replace("{", "", 2), 1, "line 1 is no JSON"),
        (lambda text: text + "[" * 100_000 + "\n", 1, "line 5 is no JSON"),
        (lambda text: text + "{}\n", 1, "line 5 is no flight"),
        (lambda text: text + "5\n", 1, "line 5 is no flight"),
        (lambda text: text.replace("wind_ms", "winds"), 1, "there is no parameter 'winds'"),
    ],
)
def test_a_hunt_goes_on_with_no_file_of_another(
    tmp_path: Path, change: Callable[[str], str], seed: int, told: str
) -> None:
    path = tmp_path / "hunt.jsonl"
    Hunt(path, flier(), 1).run(3)
    path.write_text(change(path.read_text()))
    with pytest.raises(InputError, match=told):
        Hunt(path, flier(), seed)


def test_counts_of_another_flight_are_not_gone_on_with(tmp_path: Path) -> None:
    path = tmp_path / "counts.json"
    counts.count(path, 4, flier(detail="cheap"))
    with pytest.raises(InputError, match="another flight"):
        counts.count(path, 5, flier(detail="coarse"))
    path.write_text(path.read_text().replace('"lidar_ms": ', '"lidar_ms": 9'))
    with pytest.raises(InputError, match="another flight"):
        counts.count(path, 5, flier(detail="cheap"))


@pytest.mark.parametrize("detail", DETAILS)
def test_files_say_the_detail_of_the_flights_in_them(tmp_path: Path, detail: str) -> None:
    counts.count(tmp_path / "counts.json", 1, flier(detail=detail))
    Hunt(tmp_path / "hunt.jsonl", flier(detail=detail), 1).run(1)
    counted, hunted = (
        json.loads((tmp_path / name).read_text().partition(end)[0])
        for name, end in (("counts.json", "\0"), ("hunt.jsonl", "\n"))
    )
    assert counted[detail] == hunted[detail] == DETAILS[detail]
    assert counted["kind"] == f"{detail} landings"


def test_a_flier_flies_in_its_detail_and_with_its_weakness() -> None:
    flown = []

    def fly(*how: object, **more: object) -> Outcome:
        flown.append((how, more))
        return outcome(0.3)

    Flier("full", WEAKNESSES["crosswind"], fly)(Scenario.of())
    assert flown == [((Scenario.of(), "full"), {"weakness": WEAKNESSES["crosswind"]})]


def test_counts_of_another_seed_are_not_gone_on_with(tmp_path: Path) -> None:
    path = tmp_path / "counts.json"
    counts.count(path, 4, flier(lambda _: outcome(0.3)), seed=1)
    with pytest.raises(InputError, match="another seed"):
        counts.count(path, 5, flier(lambda _: outcome(0.3)), seed=7)


@pytest.mark.parametrize(
    "change",
    [
        {"landings": 5},
        {"landings": None},
        {"ends": {"safe": 4}},
        {"by_hazard": {}},
        {"by_fault": []},
        {"unsafe": None},
        {"cpu_s": float("nan")},
        {"more": 1},
    ],
)
def test_damaged_counts_are_not_gone_on_with(tmp_path: Path, change: dict[str, object]) -> None:
    path = tmp_path / "counts.json"
    counts.count(path, 4, flier(lambda _: outcome(0.3)))
    path.write_text(json.dumps(json.loads(path.read_text()) | change))
    with pytest.raises(InputError, match="its counts do not agree"):
        counts.count(path, 5, flier(lambda _: outcome(0.3)))


def test_what_was_unsafe_before_a_failsafe_took_over_is_the_companions() -> None:
    assert end_of(-0.1, 0.2, has_landed=True, descended=True) == TAKEN
    assert end_of(-0.1, -0.1, has_landed=True, descended=True) == UNSAFE
    assert end_of(-0.1, None, has_landed=True, descended=True) == UNSAFE
    assert end_of(0.2, None, has_landed=True, descended=True) == SAFE


@pytest.mark.parametrize(
    "text",
    [
        "{}",
        '{"scenario": {"wind_ms": true}}',
        '{"scenario": {}, "weaknes": "crosswind"}',
        '{"wind_ms": 3, "weakness": "crosswind"}',
        "[" * 100_000,
        '{"scenario": {"wind_ms": NaN}}',
        '{"seed": 1.5}',
        '{"hazard": "dragon"}',
        '{"scenario": {"dragons": 3}}',
        '{"scenario": ["box"]}',
        "[1]",
        "{",
    ],
)
def test_a_file_without_a_scenario_is_one_line(tmp_path: Path, text: str) -> None:
    path = tmp_path / "one.json"
    path.write_text(text)
    with pytest.raises(InputError, match=r"one\.json") as told:
        read(path)
    assert "\n" not in str(told.value)


@pytest.mark.parametrize(
    "argument", [("--landings", "0"), ("--jobs", "-1"), ("--failures", "0"), ("--seed", "-1")]
)
def test_options_that_fly_nothing_are_refused(
    argument: tuple[str, str], monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(sys, "argv", ["tests.search", "hunt", *argument])
    with pytest.raises(SystemExit) as ended:
        main()
    assert ended.value.code == 2
    assert f"argument {argument[0]}" in capsys.readouterr().err
