"""Settings for all tests: property tests draw the same examples in every run; autopilots fly on request."""

from __future__ import annotations

from pathlib import Path

import pytest
from hypothesis import settings

settings.register_profile("fixed", derandomize=True)
settings.load_profile("fixed")

AUTOPILOTS = {"arducopter": "an ArduCopter SITL binary", "px4": "the build folder of a PX4 SITL"}


def pytest_addoption(parser: pytest.Parser) -> None:
    """Let the user name autopilots to fly; without them their tests are skipped."""
    for name, what in AUTOPILOTS.items():
        parser.addoption(f"--{name}", type=Path, default=None, metavar="PATH", help=f"{what} to fly with")


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Skip what flies an autopilot that was not named."""
    for name, what in AUTOPILOTS.items():
        if config.getoption(f"--{name}") is None:
            skip = pytest.mark.skip(reason=f"needs --{name} PATH, {what}")
            for item in items:
                if item.get_closest_marker(name):
                    item.add_marker(skip)
