"""Immediate end of the simulator program on SIGTERM and SIGINT, in any state."""

from __future__ import annotations

import os
import signal
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from sitl import __main__ as program
from sitl.__main__ import main
from sitl.scenes import NAMES
from sitl.sensors import lidars
from sitl.simulation import Simulation
from sitl.truth import truth

FLY = ["--scene", "plain", "--lidar", "none", "--mavlink", "tcpin:127.0.0.1:0", "--speedup", "0"]
FILES = ["dsm_truth.tif", "flight.json", "scene.json", "truth.tif"]
BOTH = pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])


@pytest.fixture(autouse=True)
def handlers() -> Iterator[None]:
    """Leave the handlers of both signals as they were, whatever the program does to them."""
    before = [(number, signal.getsignal(number)) for number in (signal.SIGTERM, signal.SIGINT)]
    yield
    for number, handler in before:
        assert signal.getsignal(number) is handler
        signal.signal(number, handler)


def raises_at(monkeypatch: pytest.MonkeyPatch, owner: Any, name: str, number: int, call: int = 1) -> None:
    """Let a signal come during the n-th call of a function."""
    inner, calls = getattr(owner, name), [0]

    def outer(*args: Any, **kwargs: Any) -> Any:
        calls[0] += 1
        if calls[0] == call:
            os.kill(os.getpid(), number)
        return inner(*args, **kwargs)

    monkeypatch.setattr(owner, name, outer)


@pytest.fixture
def small(monkeypatch: pytest.MonkeyPatch) -> None:
    """Judge a few cells only."""
    whole = truth.safe_map
    monkeypatch.setattr(
        truth, "safe_map", lambda world, extent, *limits: whole(world, (-2, -2, 2, 2), *limits)
    )


@BOTH
def test_a_signal_in_flight_ends_it_and_the_truth_is_written(
    number: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, small: None
) -> None:
    raises_at(monkeypatch, Simulation, "advance", number, call=5)
    assert program.main([*FLY, "--truth", str(tmp_path)]) == 0
    assert sorted(os.listdir(tmp_path)) == FILES


@BOTH
def test_a_signal_while_the_truth_is_judged_ends_the_program_without_it(
    number: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    raises_at(monkeypatch, truth, "_fit", number, call=2)
    assert program.main([*FLY, "--duration", "0.1", "--truth", str(tmp_path)]) == 128 + number
    assert os.listdir(tmp_path) == ["flight.json"]
    assert "a signal" in capsys.readouterr().err


def test_a_signal_between_two_files_leaves_no_half_of_the_truth(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, small: None
) -> None:
    raises_at(monkeypatch, truth, "_write_tif", signal.SIGTERM, call=2)
    assert program.main([*FLY, "--duration", "0.1", "--truth", str(tmp_path)]) == 128 + signal.SIGTERM
    assert os.listdir(tmp_path) == ["flight.json"]


@BOTH
def test_a_signal_before_the_flight_is_no_traceback(number: int, monkeypatch: pytest.MonkeyPatch) -> None:
    raises_at(monkeypatch, program, "_build", number)
    assert program.main(FLY) == 128 + number


def test_a_signal_ends_a_pause_of_slow_motion(monkeypatch: pytest.MonkeyPatch) -> None:
    clock, slept = [0.0], [0.0]

    def sleep(seconds: float) -> None:
        clock[0] += seconds
        slept[0] += seconds
        if slept[0] > 1.0:
            os.kill(os.getpid(), signal.SIGTERM)

    monkeypatch.setattr(time, "monotonic", lambda: clock[0])
    monkeypatch.setattr(time, "sleep", sleep)
    assert program.main([*FLY[:-1], "1e-6"]) == 0
    assert slept[0] < 1.2


@pytest.mark.parametrize(("rate", "beside"), [(30_000, (25_000, 31_250)), (9_600, (8_000, 10_000))])
def test_the_rates_named_beside_a_wrong_one_work(rate: int, beside: tuple[int, int]) -> None:
    assert lidars.rates_beside(rate) == beside
    for name in lidars.PERIODIC:
        for good in beside:
            lidars.open_port(name, np.random.default_rng(1), good, ("127.0.0.1", 9)).close()


def test_a_lidar_with_firings_of_its_own_takes_any_rate() -> None:
    lidar = ["--lidar", "vlp16", "--lidar-to", "127.0.0.1:9", "--point-rate", "30000"]
    assert program.main([*FLY, *lidar, "--duration", "0"]) == 0


# Options of the simulator's program: its help, what is refused, and in which words.


QUICK = ["--scene", "plain", "--lidar", "none", "--mavlink", "udpout:127.0.0.1:9", "--speedup", "0"]


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--param", "VISO_TYPE"], "write NAME=VALUE"),
        (["--param", "NOTHING=1"], "no such parameter or value"),
        (["--param", "VISO_TYPE=9"], "no such parameter or value"),
        (["--param", "EKF2_EV_CTRL=1"], "no such parameter or value"),
        (["--fault", "link_loss@5"], "begins at no height"),
        (["--drift", "gentle"], "invalid choice"),
        (["--lidar", "vlp16", "--imu-to", "127.0.0.1:9"], "LiDAR vlp16 has none"),
        (["--autopilot", "tcp:127.0.0.1:1", "--drift", "light"], "means nothing with --autopilot"),
        (["--autopilot", "tcp:127.0.0.1:1", "--param", "VISO_TYPE=1"], "means nothing with --autopilot"),
    ],
)
def test_what_cannot_be_is_refused(words: list[str], said: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(words) == 2
    assert said in capsys.readouterr().err


@pytest.mark.parametrize(
    "words",
    [
        ["--param", "EKF2_EN=1", "--param", "EKF2_EV_CTRL=13"],
        ["--param", "VISO_TYPE=1", "--param", "EK3_SRC2_POSXY=6"],
        ["--drift", "severe", "--fault", "gps_denied@5,yaw_drift=0.5@8"],
    ],
)
def test_what_can_be_runs(words: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    assert main([*QUICK, "--duration", "0.5", *words]) == 0
    assert '"ready": true' in capsys.readouterr().out


def test_the_help_lists_the_scenes_and_what_holds_if_an_option_is_left_out(
    capsys: pytest.CaptureFixture[str],
) -> None:
    with pytest.raises(SystemExit) as ended:
        main(["--help"])
    assert ended.value.code == 0
    shown = " ".join(capsys.readouterr().out.split())
    assert f"{', '.join(NAMES)} [default: stadium]" in shown
    assert "LiDAR points per second [default: 200000]" in shown
    assert "[default: 1; with --lockstep 0]" in shown
    assert "SUPPRESS" not in shown
