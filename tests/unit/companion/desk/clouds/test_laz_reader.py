"""LAZ reader process: its points are laspy's, and its death affects no other process."""

from __future__ import annotations

import os
import signal
from collections.abc import Iterator
from pathlib import Path

import laspy
import numpy as np
import pytest

from companion.desk.clouds.las import pieces
from companion.runtime.errors import UsageError
from tests.unit.companion.desk.survey import clouds

N = 1_010_000  # a piece, and one that is small but fills the pipe while the first is read


def readers() -> list[int]:
    """Return the process numbers of this process's readers that have not ended."""
    found = []
    for folder in Path("/proc").iterdir():
        try:
            words = (folder / "cmdline").read_bytes().split(b"\0")
            parent = (folder / "stat").read_text().rpartition(")")[2].split()[1]
        except OSError:  # no process, or one that has ended
            continue
        if parent == str(os.getpid()) and b"companion.desk.clouds.laz_reader" in words:
            found.append(int(folder.name))
    return found


def kill(reader: int) -> None:
    """End a reader, and wait until it has ended."""
    os.kill(reader, signal.SIGKILL)
    os.waitid(os.P_PID, reader, os.WEXITED | os.WNOWAIT)  # its exit code is left to its owner


@pytest.fixture(autouse=True)
def _no_other_reader() -> Iterator[None]:
    for reader in readers():
        kill(reader)
    yield
    for reader in readers():
        kill(reader)


@pytest.fixture(scope="module")
def cloud(tmp_path_factory: pytest.TempPathFactory) -> Path:
    points = np.column_stack([5e5 + np.arange(N) % 1000, 4.9e6 + np.arange(N) // 1000, np.zeros(N)])
    return clouds.write(
        tmp_path_factory.mktemp("laz") / "a b.laz", points, None, gps_time=np.arange(float(N))
    )


@pytest.fixture(scope="module")
def single(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A file of one point, for what needs a file that is read to its end."""
    return clouds.write(tmp_path_factory.mktemp("laz") / "b.laz", np.array([[5e5, 4.9e6, 1.0]]))


def waiting(single: Path) -> int:
    """Return the process number of a reader that has read one file and waits for the next."""
    assert [len(p) for p in pieces(single, 1)] == [1]
    (reader,) = readers()
    return reader


def test_points_are_those_of_the_file_with_all_their_dimensions(cloud: Path) -> None:
    with laspy.open(cloud) as reader:
        expected = reader.read_points(-1)
    found = list(pieces(cloud, N))
    assert len(found) > 1
    for name in expected.point_format.dimension_names:
        np.testing.assert_array_equal(np.concatenate([np.asarray(p[name]) for p in found]), expected[name])
    np.testing.assert_array_equal(np.concatenate([np.asarray(p.x) for p in found]), expected.x)


def test_one_process_reads_one_file_after_the_other(single: Path, tmp_path: Path) -> None:
    reader = waiting(single)
    other = clouds.write(tmp_path / "c.laz", np.tile([5e5, 4.9e6, 1.0], (2, 1)))
    assert [len(p) for p in pieces(other, 2)] == [2]
    assert readers() == [reader]


def test_a_reader_that_ends_in_a_file_is_told_and_the_next_file_is_read(cloud: Path, single: Path) -> None:
    reading = pieces(cloud, N)
    reader = waiting(single)
    next(reading)
    kill(reader)
    with pytest.raises(UsageError, match=r"a b\.laz: .* \(its reader ended with code -9\)"):
        list(reading)
    assert sum(map(len, pieces(single, 1))) == 1


def test_a_reader_that_ended_between_two_files_is_not_the_next_file_s_fault(single: Path) -> None:
    kill(waiting(single))
    assert sum(map(len, pieces(single, 1))) == 1
    assert len(readers()) == 1


def test_a_file_that_nobody_reads_to_its_end_leaves_no_process(cloud: Path, single: Path) -> None:
    reader = waiting(single)
    reading = pieces(cloud, N)
    next(reading)
    assert readers() == [reader]
    reading.close()
    assert readers() == []


def test_a_corrupt_file_is_refused_in_one_line_and_the_reader_goes_on(
    cloud: Path, single: Path, tmp_path: Path
) -> None:
    reader = waiting(single)
    data = bytearray(cloud.read_bytes())
    with laspy.open(cloud) as opened:
        begin = opened.header.offset_to_point_data
    data[begin + 300 : begin + 5000] = bytes(4700)
    corrupt = tmp_path / "corrupt.laz"
    corrupt.write_bytes(data)
    with pytest.raises(UsageError, match=r"corrupt\.laz: it is truncated or corrupt \(") as raised:
        list(pieces(corrupt, N))
    assert "\n" not in str(raised.value)
    if "reader ended" not in str(raised.value):
        assert readers() == [reader]
    assert sum(map(len, pieces(single, 1))) == 1
