"""Completeness of docs/messages.md: every text that the program can send, and no other."""

from __future__ import annotations

import re
from importlib import resources

import params
from companion.flight.link.statustext import CHUNK_BYTES
from tests import REPOSITORY
from tests.unit.docs.said import SOURCES, files_that_speak, templates

PAGE = (REPOSITORY / "docs" / "messages.md").read_text("utf-8")
# They define how to speak, or hand on what others say.
SILENT = {"companion/flight/services/services.py", "companion/flight/link/statustext.py"}
ROWS = [
    [cell.strip() for cell in line.strip("|").split("|")]
    for line in PAGE.splitlines()
    if line.startswith("| `")
]


def told() -> set[str]:
    return {text for row in ROWS for text in re.findall(r"`([^`]+)`", row[0])}


def filled_in() -> set[str]:
    """What the second or third column says is filled in, such as `LiDAR`."""
    return set(re.findall(r"`([^`]+)`", PAGE)) - told()


def test_every_text_that_the_program_can_say_is_explained() -> None:
    said = templates()
    assert len(said) > 70
    assert sorted(said.keys() - told() - filled_in()) == []


def test_no_text_is_explained_that_the_program_cannot_say() -> None:
    assert sorted(told() - templates().keys()) == []


def test_severities_are_those_of_the_source() -> None:
    said = templates()
    of_page = {
        row[0].strip("`"): row[1] for row in ROWS if row[0].strip("`") in said and said[row[0].strip("`")]
    }
    assert len(of_page) > 25
    assert {text: said[text] for text in of_page} == of_page


def test_every_file_that_speaks_to_the_pilot_is_read() -> None:
    assert files_that_speak() - SILENT <= set(SOURCES)


def test_every_text_of_a_flight_without_gaps_fits_one_statustext() -> None:
    """A narrow screen shows the 50 bytes of one message, and a longer text in pieces."""
    flown = PAGE.split("## In flight")[1].split("\n## ")[0]
    cells = [line.strip("|").split("|")[0] for line in flown.splitlines() if line.startswith("| `")]
    said = [f"SLZ: {text}" for cell in cells for text in re.findall(r"`([^`]+)`", cell)]
    assert len(said) > 90
    assert [text for text in said if len(text.replace("…", "")) > CHUNK_BYTES] == []


# Names and numbers on the documentation pages, against the program.


DOCS = REPOSITORY / "docs"
TABLE = {row.mavlink for row in params.rows()} | {"SLZ_SELECT", "SLZ_DO"}
STATUS = REPOSITORY / "companion/flight/outputs/landing_status.py"
TOLD = set(re.findall(r"SLZ_\w+", STATUS.read_text("utf-8")))
ENVIRONMENT = set(re.findall(r"SLZ_\w+", (REPOSITORY / "deploy/slz.env").read_text("utf-8")))


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
