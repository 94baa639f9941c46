"""Options of the simulator's program: its help, what is refused, and in which words."""

from __future__ import annotations

import pytest

from sitl.__main__ import main
from sitl.scenes import NAMES

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
