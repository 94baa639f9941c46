"""Distinction of errors in a file from those of the disk, the network or memory."""

from __future__ import annotations

import errno
import io
from collections.abc import Callable
from pathlib import Path
from typing import Any

import laspy
import pytest

from companion.desk.clouds.cloud import cloud_format_of
from companion.desk.clouds.cloud_source import translated
from companion.desk.clouds.las import check_header, open_las
from companion.runtime.errors import CompanionError, UsageError
from tests.unit.companion.desk.survey.clouds import field, placed, write

PATH = Path("a.laz")


@pytest.mark.parametrize(
    "error",
    [ValueError("bad"), EOFError(), OSError("no errno"), OSError(errno.EINVAL, "seek"), SystemError("panic")],
)
def test_what_a_decoder_raises_is_a_corrupt_file(error: Exception) -> None:
    with pytest.raises(UsageError, match=r"a\.laz: it is truncated or corrupt"), translated(PATH):
        raise error


@pytest.mark.parametrize("error", [OSError(errno.EIO, "I/O"), TimeoutError(110, "timed out"), MemoryError()])
def test_what_the_system_raises_is_no_corrupt_file(error: Exception) -> None:
    said = r"a\.laz: reading it failed \(.*\): run again"
    with pytest.raises(CompanionError, match=said) as caught, translated(PATH), translated(PATH):
        raise error
    assert not isinstance(caught.value, UsageError)


class Failing(io.FileIO):
    """A file of which nothing can be read once `fails` is set."""

    fails = False

    def readinto(self, buffer: Any) -> int | None:
        if self.fails:
            raise OSError(errno.EIO, "Input/output error")
        return super().readinto(buffer)

    def read(self, size: int | None = -1) -> bytes | None:
        if self.fails:
            raise OSError(errno.EIO, "Input/output error")
        return super().read(-1 if size is None else size)


@pytest.mark.parametrize("suffix", ["las", "laz"])
def test_a_disk_that_fails_within_a_file_is_no_corrupt_file(tmp_path: Path, suffix: str) -> None:
    """The decompressor hides the error of the file it reads from."""
    path = write(tmp_path / f"a.{suffix}", placed(field(), "EPSG:32610"))
    with Failing(path) as file, laspy.open(file, laz_backend=[laspy.LazBackend.Lazrs]) as reader:
        file.fails = True
        with pytest.raises(CompanionError, match="reading it failed") as caught, translated(path):
            reader.read_points(100)
    assert not isinstance(caught.value, UsageError)


@pytest.mark.parametrize("use", [cloud_format_of, check_header, lambda path: open_las(path, None)])
@pytest.mark.parametrize(("number", "lasting"), [(errno.EIO, False), (errno.EACCES, True)])
def test_only_a_file_that_is_refused_for_good_is_left_out(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, use: Callable[[Path], Any], number: int, lasting: bool
) -> None:
    def opened(*_: object) -> None:
        raise OSError(number, "no")

    monkeypatch.setattr(Path, "open", opened)
    with pytest.raises(CompanionError) as caught:
        use(tmp_path / "a.laz")
    assert isinstance(caught.value, UsageError) == lasting
