"""Persistent settings, and those that take effect at once."""

from __future__ import annotations

import threading
from pathlib import Path

import pytest

import params
from companion.flight.services.settings import FILE, Settings, load
from companion.runtime.errors import UsageError
from companion.runtime.state_directory import StateDir, default_state_dir


def test_changes_are_loaded_at_the_next_start_and_the_command_line_wins(tmp_path: Path) -> None:
    state = StateDir(tmp_path)
    settings = Settings(load("quadcopter", [], state), state)
    assert settings.change("cell_m", 0.25).accepted
    assert settings.change("fusing", "max").accepted
    again = Settings(load("quadcopter", [], state), state)
    assert (again.running.cell_m, again.running.fusing) == (0.25, "max")
    assert again.change("final_height_m", 15.0).accepted
    last = load("quadcopter", ["cell_m=0.3"], state)
    assert (last.cell_m, last.fusing, last.final_height_m) == (0.3, "max", 15.0)


def test_only_what_was_changed_is_stored(tmp_path: Path) -> None:
    state = StateDir(tmp_path)
    settings = Settings(params.load("helicopter"), state)
    settings.change("histogram_bins", 200)
    settings.change("safe_slope_deg", 4.0)  # as it was
    assert (state.read(FILE) or "").splitlines()[1:] == ["histogram_bins = 200"]
    assert not list(tmp_path.glob(".*"))


def test_a_disk_that_takes_its_time_holds_up_nobody(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    done = threading.Event()
    monkeypatch.setattr("os.fsync", lambda _file: done.wait(30.0))
    state = StateDir(tmp_path)
    settings = Settings(params.Parameters(), state)
    assert settings.change("hold_s", 100.0).accepted
    assert settings.change("hold_s", 90.0).accepted
    assert settings.stored.hold_s == 90.0
    assert not (tmp_path / FILE).exists()  # nothing is in its place before it would survive a power cut
    done.set()
    assert "hold_s = 90.0" in (state.read(FILE) or "")
    assert not list(tmp_path.glob(".*"))


def test_what_the_disk_refuses_late_is_logged(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    def refuse(_file: int) -> None:
        raise OSError(5, "Input/output error")

    monkeypatch.setattr("os.fsync", refuse)
    state = StateDir(tmp_path)
    assert Settings(params.Parameters(), state).change("hold_s", 100.0).accepted
    assert state.read(FILE) is None
    assert "parameters.toml not kept: Input/output error" in caplog.text


def test_a_live_value_must_go_with_those_in_force_and_with_those_of_the_next_start() -> None:
    settings = Settings(params.Parameters())
    assert settings.change("hold_s", 100.0).accepted
    refused = settings.change("commit_height_m", 50.0)
    assert not refused.accepted
    assert "final_height_m" in refused.reason
    assert settings.change("final_height_m", 60.0).accepted
    assert settings.change("commit_height_m", 50.0).accepted
    assert (settings.live.commit_height_m, settings.live.hold_s) == (50.0, 8.0)


def test_the_live_view_shows_a_change_after_it_was_read() -> None:
    settings = Settings(params.Parameters())
    live = settings.live
    assert (live.survey_s, live.hold_s) == (settings.running.survey_s, 8.0)
    assert settings.change("survey_s", 33.0).accepted
    assert (live.survey_s, live.hold_s) == (33.0, 8.0)


@pytest.mark.parametrize(("name", "value"), [("odometry", "autopilot"), ("mode", "source")])
def test_a_value_that_must_not_fly_is_refused_and_the_old_one_kept(
    name: str, value: str, tmp_path: Path
) -> None:
    settings = Settings(params.Parameters(), StateDir(tmp_path))
    refused = settings.change(name, value)
    assert not refused.accepted
    assert value in refused.reason
    assert settings.stored == settings.running == params.Parameters()
    assert settings.change("odometry", "map").accepted
    earlier = StateDir(tmp_path / "earlier")
    assert earlier.write(FILE, f'{name} = "{value}"\n') == ""
    with pytest.raises(UsageError, match="must not fly.*mend or delete"):
        load("quadcopter", [], earlier)


def test_what_was_set_is_told_and_what_was_refused_is_not() -> None:
    settings, told = Settings(params.Parameters()), []
    settings.on_change.subscribe(lambda name, value: told.append((name, value)))
    settings.change("hold_s", 100.0)
    settings.change("hold_s", -1.0)
    assert told == [("hold_s", 100.0)]


@pytest.mark.parametrize(
    ("text", "words"),
    [("cell_m = ", "parameters.toml"), ("cell_m = 99", "0.05 to 50 m"), ("cel_m = 1", "did you mean")],
)
def test_a_broken_file_is_one_line_that_names_it(tmp_path: Path, text: str, words: str) -> None:
    (tmp_path / FILE).write_text(text)
    with pytest.raises(UsageError, match="mend or delete") as caught:
        load("quadcopter", [], StateDir(tmp_path))
    assert words in str(caught.value)
    assert str(tmp_path / FILE) in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_folder_that_cannot_be_written_is_refused(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(UsageError, match="--state-dir"):
        StateDir(tmp_path / "file" / "state")


def test_the_default_folder_is_the_user_s_state_home(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_STATE_HOME", "/var/state")
    assert default_state_dir() == Path("/var/state/slz")
    monkeypatch.setenv("XDG_STATE_HOME", "relative")
    assert default_state_dir() == Path.home() / ".local/state/slz"
