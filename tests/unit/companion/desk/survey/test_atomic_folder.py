"""Output folder: all results or none, and work kept only if it is worth keeping."""

from __future__ import annotations

import signal
from pathlib import Path
from typing import Any

import pytest

from companion.desk.survey import atomic_folder
from companion.desk.survey.atomic_folder import check_output_path, finish, locked_folder, work_folder
from companion.runtime.errors import UsageError
from companion.runtime.interrupt import Interrupted


def written(folder: Path) -> list[Path]:
    folder.mkdir()
    paths = [folder / name for name in "abc"]
    for path in paths:
        path.write_text(path.name)
    return paths


def test_a_signal_between_two_results_leaves_all_of_them(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    paths, moved, replace = written(tmp_path / "work"), list[str](), Path.replace

    def interrupted(path: Path, target: Path) -> Any:
        moved.append(path.name)
        if len(moved) == 2:
            raise Interrupted(signal.SIGTERM)
        return replace(path, target)

    monkeypatch.setattr(Path, "replace", interrupted)
    with pytest.raises(Interrupted):
        finish(paths, tmp_path)
    assert [(tmp_path / name).read_text() for name in "abc"] == ["a", "b", "c"]
    assert not any(path.exists() for path in paths)


def test_a_folder_may_be_any_that_can_be_made(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "file").touch()
    for there in (tmp_path, tmp_path / "not" / "yet", Path("not/yet")):
        check_output_path(there)
    with pytest.raises(UsageError, match=r"--out file/maps: file is a file: name a folder"):
        check_output_path(Path("file/maps"))
    assert [path.name for path in tmp_path.iterdir()] == ["file"]


def test_a_file_system_without_locks_is_no_reason_to_refuse(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def without(*_: Any) -> None:
        raise OSError(95, "Operation not supported")

    monkeypatch.setattr("fcntl.flock", without)
    with locked_folder(tmp_path / "out"):
        (tmp_path / "out" / "zones.csv").touch()
    assert (tmp_path / "out" / "zones.csv").exists()


@pytest.mark.parametrize("error", [UsageError("with other files"), Interrupted(signal.SIGINT)])
@pytest.mark.parametrize(
    ("before", "size", "kept"), [(False, 100, False), (True, 100, True), (False, 1000, True)]
)
def test_work_is_kept_when_there_was_some_before_or_much_was_done(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    error: BaseException,
    before: bool,
    size: int,
    kept: bool,
) -> None:
    monkeypatch.setattr(atomic_folder, "WORTH_BYTES", 1000)
    folder = tmp_path / atomic_folder.WORK
    if before:
        folder.mkdir()

    def work() -> None:
        with work_folder(tmp_path) as here:
            (here / "tiles").mkdir()
            (here / "tiles" / "0_0.tile").write_bytes(bytes(size))
            raise error

    with pytest.raises(type(error)):
        work()
    # A survey that is refused has done nothing in a folder of its own that anybody could go on with.
    assert folder.exists() == (before if isinstance(error, UsageError) else kept)


def test_work_that_is_done_is_removed(tmp_path: Path) -> None:
    with work_folder(tmp_path) as folder:
        (folder / "0.sorted").touch()
    assert list(tmp_path.iterdir()) == []
