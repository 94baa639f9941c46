"""The wheel, installed in an environment of its own, away from the checkout."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
import zipfile
from importlib.metadata import version
from pathlib import Path

import pytest

from tests import REPOSITORY

PACKAGES = ("slz", "companion", "params", "sitl")
BUILT_FROM = (*PACKAGES, "pyproject.toml", "README.md", "LICENSE", "NOTICE")
FEWEST = 77  # of setuptools, for the licence as pyproject.toml writes it
BUILD = "import sys; from setuptools import build_meta as b; print(b.build_{}(sys.argv[1]))"
DEMO = ["demo", "--headless", "--scene", "plain", "--point-rate", "20000", "--json"]
SHORT = ["--limit-s", "3", "--set", "zone_m=60", "--out", "maps"]  # ends before the landing

pytestmark = pytest.mark.skipif(
    int(version("setuptools").partition(".")[0]) < FEWEST, reason="needs setuptools 77: make setup"
)


def built(kind: str, folder: Path, out: Path) -> Path:
    """Return what setuptools builds from a folder."""
    command = [sys.executable, "-c", BUILD.format(kind), str(out)]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=True)
    return out / done.stdout.splitlines()[-1]


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A wheel built from a source distribution of the checkout."""
    folder, out = tmp_path_factory.mktemp("source"), tmp_path_factory.mktemp("dist")
    for name in BUILT_FROM:
        path = REPOSITORY / name
        if path.is_dir():
            shutil.copytree(path, folder / name, ignore=shutil.ignore_patterns("__pycache__"))
        else:
            shutil.copy(path, folder / name)
    shutil.unpack_archive(built("sdist", folder, out), out)
    (unpacked,) = (path for path in out.iterdir() if path.is_dir())
    return built("wheel", unpacked, out)


@pytest.fixture(scope="module")
def installed(wheel: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The program of an environment that has the wheel, and this environment's libraries."""
    home = tmp_path_factory.mktemp("environment")
    subprocess.run([sys.executable, "-m", "venv", "--without-pip", home], check=True)
    python = home / "bin" / "python"
    install = [sys.executable, "-m", "pip", "--python", str(python), "install", "--quiet", "--no-deps"]
    install += ["--no-index", "--no-compile", "--disable-pip-version-check", str(wheel)]
    subprocess.run(install, check=True, capture_output=True)
    (packages,) = home.glob("lib/python3.*/site-packages")
    libraries = [path for path in sys.path if path.endswith("site-packages")]
    (packages / "libraries.pth").write_text("\n".join(libraries))
    _keep_compiled_kernels(packages)
    return home / "bin" / "slz"


def _keep_compiled_kernels(packages: Path) -> None:
    """Copy the kernels that are compiled in the checkout, which Numba recognises by their sources' stamps."""
    for name in PACKAGES:
        for path in (REPOSITORY / name).rglob("*.py"):
            shutil.copystat(path, packages / path.relative_to(REPOSITORY))
        for path in (REPOSITORY / name).rglob("*.nb[ic]"):
            place = packages / path.relative_to(REPOSITORY)
            place.parent.mkdir(exist_ok=True)
            shutil.copy2(path, place)


def run(program: Path, folder: Path, *words: str, **more: str) -> subprocess.CompletedProcess[str]:
    own = {name: value for name, value in os.environ.items() if name not in ("PYTHONPATH", "NUMBA_CACHE_DIR")}
    environment = own | {"XDG_STATE_HOME": str(folder / "state"), **more}
    return subprocess.run([program, *words], cwd=folder, env=environment, capture_output=True, text=True)


def test_the_wheel_holds_every_file_of_the_packages_and_no_other(wheel: Path) -> None:
    held = {name for name in zipfile.ZipFile(wheel).namelist() if ".dist-info/" not in name}
    ours = {
        path.relative_to(REPOSITORY).as_posix()
        for package in PACKAGES
        for path in (REPOSITORY / package).rglob("*")
        if path.is_file() and path.parent.name != "__pycache__" and path.name != "README.md"  # of the source
    }
    assert held == ours


def test_a_demo_flies_in_an_empty_folder_from_the_wheel(installed: Path, tmp_path: Path) -> None:
    done = run(installed, tmp_path, *DEMO, *SHORT)
    assert done.returncode == 1, done.stderr[-2000:]
    summary = json.loads(done.stdout)
    assert not summary["landed"]
    assert summary["lidar"]["packets"] > 0
    assert (tmp_path / "maps" / "truth.tif").is_file()


def test_the_program_tells_its_versions_and_reads_its_own_files(installed: Path, tmp_path: Path) -> None:
    told = run(installed, tmp_path, "--version").stdout
    assert told.startswith(f"slz {version('slz')}, Python {sys.version.split()[0]}, numba {version('numba')}")
    assert told.count("\n") == 1
    listed = run(installed, tmp_path, "params", "--profile", "helicopter", "--json")
    assert json.loads(listed.stdout)["survey_height_m"]["value"] == 60.0
    assert "COM_OBL_RC_ACT" in run(installed, tmp_path, "params", "--autopilot", "px4").stdout


def test_completion_is_printed_and_writes_nothing(installed: Path, tmp_path: Path) -> None:
    done = run(installed, tmp_path, HOME=str(tmp_path), _SLZ_COMPLETE="source_bash")
    assert (done.returncode, done.stderr) == (0, "")
    assert "complete " in done.stdout
    assert not list(tmp_path.iterdir())
