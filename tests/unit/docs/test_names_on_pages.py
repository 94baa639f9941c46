"""Names and numbers on the documentation pages, against the program."""

from __future__ import annotations

import re
from importlib import resources

import params
from tests import REPOSITORY

DOCS = REPOSITORY / "docs"
TABLE = {row.mavlink for row in params.rows()} | {"SLZ_SELECT", "SLZ_DO"}
STATUS = REPOSITORY / "companion/flight/outputs/landing_status.py"
TOLD = set(re.findall(r"SLZ_\w+", STATUS.read_text("utf-8")))
VARIABLES = ("deploy/slz.env", "tests/answers/shared.py")
ENVIRONMENT = {
    name for path in VARIABLES for name in re.findall(r"SLZ_\w+", (REPOSITORY / path).read_text("utf-8"))
}


def test_every_parameter_named_on_a_page_is_in_the_table() -> None:
    pages = set(DOCS.rglob("*.md")) - set(DOCS.glob("benchmark/*.md"))  # these name variables of benches
    for page in pages:
        named = set(re.findall(r"\bSLZ_[A-Z][A-Z_]*[A-Z]\b", page.read_text("utf-8")))
        assert named - TABLE - TOLD - ENVIRONMENT == set(), page.name


def test_settings_of_the_tuning_page_are_parameters() -> None:
    names = {row.name for row in params.rows()}
    text = "".join((DOCS / page).read_text("utf-8") for page in ("tuning.md", "quickstart.md", "sensors.md"))
    assert set(re.findall(r"--set (\w+)=[\d.a-z]", text)) <= names


def test_autopilot_parameters_of_the_hardware_page_are_those_of_the_files() -> None:
    folder = resources.files("params").joinpath("autopilot")
    parm, params4 = (folder.joinpath(name).read_text("utf-8") for name in ("arducopter.parm", "px4.params"))
    copter = dict(re.findall(r"^(\w+) ([\d.]+)$", parm, re.MULTILINE))
    px4 = dict(re.findall(r"^1\t1\t(\w+)\t([\d.]+)", params4, re.MULTILINE))
    told = re.findall(
        r"`((?!SERIAL|SER_|MAV_)[A-Z][A-Z0-9_]+) ([\d.]+)`", (DOCS / "hardware.md").read_text("utf-8")
    )
    assert len(told) > 8
    for name, value in told:
        assert float((copter | px4)[name]) == float(value), name
