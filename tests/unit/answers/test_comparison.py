"""Two records: equal ones are silent, and every way to differ is named in one line."""

from __future__ import annotations

import copy
import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.answers.__main__ import main
from tests.answers.comparison import compared
from tests.answers.store import Store

ANSWER = {
    "zones": [{"id": 1, "area_m2": 12.5}, {"id": 2, "area_m2": math.nan}],
    "maps": {"slope": np.arange(6, dtype=np.float32).reshape(2, 3)},
}


def record(folder: Path, answer: Any, **others: Any) -> Store:
    store = Store(folder)
    for name, tree in {"flight": answer, **others}.items():
        store.add("part", name, tree)
    store.finish("part", failed=False, skipped=[])
    return Store(folder)


def lines(tmp_path: Path, after: Any) -> list[str]:
    return list(compared(record(tmp_path / "before", ANSWER), record(tmp_path / "after", after)))


def changed(change: Any) -> Any:
    answer = copy.deepcopy(ANSWER)
    change(answer)
    return answer


def test_equal_records_have_no_difference(tmp_path: Path) -> None:
    assert lines(tmp_path, copy.deepcopy(ANSWER)) == []


def test_order_of_keys_is_no_difference(tmp_path: Path) -> None:
    assert lines(tmp_path, dict(reversed(ANSWER.items()))) == []


def test_a_changed_number_is_named(tmp_path: Path) -> None:
    after = changed(lambda a: a["zones"][0].update(area_m2=np.nextafter(12.5, 13.0)))
    assert lines(tmp_path, after) == ["flight: zones[0].area_m2: 12.5 before, 12.500000000000002 after"]


def test_a_number_that_becomes_nan_is_named(tmp_path: Path) -> None:
    after = changed(lambda a: a["zones"][0].update(area_m2=math.nan))
    assert lines(tmp_path, after) == ["flight: zones[0].area_m2: 12.5 before, nan after"]


def test_a_whole_number_that_becomes_a_float_is_named(tmp_path: Path) -> None:
    after = changed(lambda a: a["zones"][0].update(id=1.0))
    assert lines(tmp_path, after) == ["flight: zones[0].id: 1 before, 1.0 after"]


def test_an_added_and_a_missing_key_are_named(tmp_path: Path) -> None:
    after = changed(lambda a: a.update(near=True) or a["zones"][1].pop("id"))
    assert lines(tmp_path, after) == [
        "flight: zones[1].id: missing after, was 2",
        "flight: near: added: True",
    ]


def test_a_shorter_list_is_named(tmp_path: Path) -> None:
    assert lines(tmp_path, changed(lambda a: a["zones"].pop())) == ["flight: zones.length: 2 before, 1 after"]


def test_the_first_changed_element_of_an_array_is_named(tmp_path: Path) -> None:
    def change(answer: Any) -> None:
        answer["maps"]["slope"][1, 1:] = 9.0

    (line,) = lines(tmp_path, changed(change))
    assert line.startswith("flight: maps.slope[1, 1]: ")
    assert line.endswith("; 2 of 6 elements differ")
    assert "4.0" in line
    assert "9.0" in line


def test_a_zero_of_another_sign_is_a_difference(tmp_path: Path) -> None:
    def change(answer: Any) -> None:
        answer["maps"]["slope"][0, 0] = -0.0

    assert len(lines(tmp_path, changed(change))) == 1


@pytest.mark.parametrize(
    ("other", "what"),
    [
        (np.arange(6.0).reshape(2, 3), "maps.slope.dtype: float32 before, float64 after"),
        (np.arange(6, dtype=np.float32), "maps.slope.shape: (2, 3) before, (6,) after"),
    ],
)
def test_another_dtype_or_shape_is_named(tmp_path: Path, other: Any, what: str) -> None:
    assert lines(tmp_path, changed(lambda a: a["maps"].update(slope=other))) == [f"flight: {what}"]


def test_differences_of_one_kind_are_one_line(tmp_path: Path) -> None:
    before = record(tmp_path / "before", [{"new": k} for k in range(5)])
    after = record(tmp_path / "after", [{} for _ in range(5)])
    assert list(compared(before, after)) == ["flight: [0].new: missing after, was 0 (and 4 more at [*].new)"]


def test_a_missing_and_an_added_answer_are_named(tmp_path: Path) -> None:
    before = record(tmp_path / "before", ANSWER, old=1)
    after = record(tmp_path / "after", ANSWER, new=1)
    assert list(compared(before, after)) == ["old: missing after", "new: added"]


def test_a_file_that_was_deleted_or_changed_by_hand_is_named(tmp_path: Path) -> None:
    before = record(tmp_path / "before", ANSWER, text="a", other="b")
    after = record(tmp_path / "after", ANSWER, text="c", other="d")
    (tmp_path / "after" / "text.json.gz").unlink()
    (tmp_path / "after" / "other.json.gz").write_bytes((tmp_path / "before" / "other.json.gz").read_bytes())
    first, second = compared(before, after)
    assert first == "other: its file after does not fit the manifest"
    assert second.startswith("text: cannot be read after: ")


def test_parts_that_failed_or_were_left_out_are_named(tmp_path: Path) -> None:
    before, after = record(tmp_path / "before", ANSWER), record(tmp_path / "after", ANSWER)
    before.finish("bench", failed=False, skipped=[])
    after.finish("part", failed=True)
    after.finish("map", failed=False, skipped=[])
    assert list(compared(before, after)) == [
        "bench: recorded only before",
        "map: recorded only after",
        "part: failed after",
        "part: left out [] before, None after",
    ]


def test_an_empty_record_is_a_difference(tmp_path: Path) -> None:
    found = list(compared(Store(tmp_path / "one"), Store(tmp_path / "two")))
    assert found == [f"{tmp_path / name}: holds no answers" for name in ("one", "two")]


def test_a_part_recorded_again_replaces_its_answers(tmp_path: Path) -> None:
    store = record(tmp_path, ANSWER)
    store.forget("part")
    assert store.digests == {}
    assert not (tmp_path / "flight.json.gz").exists()
    assert not (tmp_path / "flight.npz").exists()


def test_the_command_exits_1_with_the_differences(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    record(tmp_path / "before", {"x": 1})
    record(tmp_path / "after", {"x": 2})
    folders = [str(tmp_path / "before"), str(tmp_path / "after")]
    assert main(["compare", *folders]) == 1
    assert capsys.readouterr().out == "flight: x: 1 before, 2 after\n"
    assert main(["compare", folders[0], folders[0]]) == 0
    assert capsys.readouterr().out == "1 answers, bit for bit the same\n"


def test_the_manifest_holds_a_digest_of_each_answer(tmp_path: Path) -> None:
    record(tmp_path, ANSWER)
    entry = json.loads((tmp_path / "manifest.json").read_text())["answers"]["flight"]
    assert entry["part"] == "part"
    assert len(entry["sha256"]) == 64
