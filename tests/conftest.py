"""Settings for all tests: property tests draw the same examples in every run."""

from __future__ import annotations

from pathlib import Path

import pytest
from hypothesis import settings

settings.register_profile("fixed", derandomize=True)
settings.load_profile("fixed")


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--mavproxy", metavar="PATH", help="mavproxy.py for the tests with it as ground station")


@pytest.fixture(scope="session", autouse=True)
def state_home(tmp_path_factory: pytest.TempPathFactory) -> object:
    """Keep what programs under test remember out of the user's own folder."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("XDG_STATE_HOME", str(tmp_path_factory.mktemp("state")))
        yield


@pytest.fixture
def mavproxy(request: pytest.FixtureRequest) -> Path:
    """Return the program that --mavproxy names; skip without it."""
    path = request.config.getoption("--mavproxy")
    if path is None:
        pytest.skip("needs --mavproxy PATH (pip install --no-deps MAVProxy)")
    return Path(path)
