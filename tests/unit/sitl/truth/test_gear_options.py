"""Options of the gear: their defaults are the quadcopter's."""

from __future__ import annotations

import argparse

import pytest

from sitl.truth import gear_options
from sitl.truth.standing_gear import QUADCOPTER, gear_of


def parsed(*words: str) -> argparse.Namespace:
    parser = argparse.ArgumentParser()
    gear_options.add_options(parser)
    return parser.parse_args(words)


def test_without_options_it_is_the_quadcopter() -> None:
    assert gear_options.chosen(parsed()) == QUADCOPTER
    assert parsed().tip_limit == 15.0


def test_each_option_counts() -> None:
    words = "--gear skids --gear-length 3 --gear-width 2.2 --pad-radius 0.05 --clearance 0.4 --tip-limit 10"
    options = parsed(*words.split())
    assert gear_options.chosen(options) == gear_of("skids", 3.0, 2.2, 0.05, 0.4)
    assert options.tip_limit == 10.0


def test_there_is_no_vehicle_without_a_gear(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        parsed("--gear", "none")
    assert "invalid choice: 'none'" in capsys.readouterr().err
