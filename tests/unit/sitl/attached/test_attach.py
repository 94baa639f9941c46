"""`slz sim --autopilot`: refusals."""

from pathlib import Path

import pytest

from sitl.__main__ import main


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["--autopilot", "nonsense"], "is no autopilot's address"),
        (["--autopilot", "tcp:127.0.0.1:5762", "--pilot", "takeoff"], "--pilot means nothing"),
        (["--autopilot", "tcp:127.0.0.1:5762", "--wind", "5"], "--wind means nothing"),
        (["--autopilot", "tcp:127.0.0.1:5762", "--wind-from", "90"], "--wind-from means nothing"),
        (["--autopilot", "tcp:127.0.0.1:5762", "--lockstep", "0"], "--lockstep means nothing"),
        (["--autopilot", "tcp:127.0.0.1:5762", "--mavlink", "udpin:0:1"], "--mavlink means nothing"),
        (["--autopilot", "tcp:127.0.0.1:5762", "--origin", "1,2"], "write LAT,LON,ALT"),
    ],
)
def test_bad_arguments_are_one_line(
    arguments: list[str], said: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(arguments) == 2
    err = capsys.readouterr().err
    assert said in err
    assert err.count("\n") == 1


def test_without_an_autopilot_it_says_so_and_has_no_truth_to_write(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    arguments = ["--autopilot", "tcp:127.0.0.1:9", "--scene", "hill", "--duration", "0"]
    assert main([*arguments, "--truth", str(tmp_path)]) == 1
    captured = capsys.readouterr()
    assert "waiting for an autopilot at tcp:127.0.0.1:9" in captured.err
    assert "nothing is written" in captured.err
    assert captured.out == ""
