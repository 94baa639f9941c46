"""Settings for all tests: property tests use the same examples in every run; external programs are named."""

from __future__ import annotations

import gc
import logging
import shutil
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from _pytest.junitxml import xml_key
from hypothesis import settings

settings.register_profile("fixed", derandomize=True, deadline=None)
settings.load_profile("fixed")

AUTOPILOTS = {
    "arducopter": "an ArduCopter SITL binary",
    "px4": "the binary of a PX4 SITL (bin/px4 of its build folder)",
}
# Whole folders and modules that `make test` leaves out: the simulator, the desk, what is off by default.
LONG = (
    "tests/unit/sitl/",
    "tests/unit/companion/desk/",
    "tests/unit/test_package.py",
    "tests/unit/test_flight_judges.py",
    "tests/unit/companion/flight/fusion/odometry/",
    "tests/unit/companion/flight/fusion/external_odometry/",
    "tests/integration/test_survey_",
    "tests/integration/test_odometry_loop.py",
)
CHROMIUM = Path(shutil.which("chromium") or "/usr/bin/chromium")
MAVPROXY = Path(sys.executable).with_name("mavproxy.py")


def pytest_addoption(parser: pytest.Parser) -> None:
    """Let the user name programs to test with; without them their tests are skipped."""
    for name, what in AUTOPILOTS.items():
        parser.addoption(f"--{name}", type=Path, default=None, metavar="PATH", help=f"{what} to fly with")
    parser.addoption(
        "--chromium", type=Path, default=CHROMIUM, metavar="PATH", help="Chromium to test the page with"
    )
    parser.addoption(
        "--mavproxy", type=Path, default=MAVPROXY, metavar="PATH", help="mavproxy.py to test with"
    )


def pytest_sessionstart(session: pytest.Session) -> None:
    """Record the version of the program in `--junitxml`; the fixture for it does not work with workers."""
    report = session.config.stash.get(xml_key, None)
    if report is not None:
        from companion.desk.evidence.artefact_file import PROGRAM_PROPERTY
        from companion.runtime.program_version import program_version

        report.add_global_property(PROGRAM_PROPERTY, program_version())


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Skip what flies an autopilot that was not named, and mark what is long as a whole."""
    for item in items:
        if item.nodeid.startswith(LONG):
            item.add_marker(pytest.mark.long)
    for name, what in AUTOPILOTS.items():
        if config.getoption(f"--{name}") is None:
            skip = pytest.mark.skip(reason=f"needs --{name} PATH, {what}")
            for item in items:
                if item.get_closest_marker(name):
                    item.add_marker(skip)


def pytest_collection_finish() -> None:
    """Let collections of garbage pass over thousands of tests and what they import, which stays anyway."""
    gc.collect()
    gc.freeze()


@pytest.fixture(scope="session", autouse=True)
def state_home(tmp_path_factory: pytest.TempPathFactory) -> object:
    """Keep what programs under test remember out of the user's own folder."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("XDG_STATE_HOME", str(tmp_path_factory.mktemp("state")))
        yield


@pytest.fixture
def chromium(request: pytest.FixtureRequest) -> Path:
    """Return the browser, by default Debian's; skip without it."""
    path: Path = request.config.getoption("--chromium")
    if not path.is_file():
        pytest.skip(f"there is no {path}: apt install chromium")
    return path


@pytest.fixture
def mavproxy(request: pytest.FixtureRequest) -> Path:
    """Return the program, by default the one that `make setup` installs; skip without it."""
    path: Path = request.config.getoption("--mavproxy")
    if not path.is_file():
        pytest.skip(f"there is no {path}: pip install --no-deps MAVProxy")
    return path.resolve()


@pytest.fixture(autouse=True)
def _logging_stays_on() -> Iterator[None]:
    """Switch logging on again after each test: some programs that tests run switch it off for good."""
    yield
    logging.disable(logging.NOTSET)
