"""Mutants: sampling, exclusions, and visibility of a kernel's mutant to calling kernels."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

pytest.importorskip(
    "cosmic_ray", reason="mutation sampling needs: pip install -c constraints.txt '.[mutation]'"
)

from tests.mutation.mutants import Mutant, changed, meaning, of_file, sample
from tests.mutation.reached import statement

SOURCE = '''"""A module."""
from __future__ import annotations


@kernel
def half(x: float | None) -> float:
    if x > 1:
        return (
            x
            + 2
        )
    return x * 3
'''

PLANTED = """
from pathlib import Path
from tests.mutation import trial

trial.prepare()
root = Path.cwd()
path = "slz/kernels/raster/bitmap.py"
source = (root / path).read_text()
helper = "word ^= word << np.uint64(shift)"
assert helper in source
for text in (source, source.replace(helper, helper.replace("^=", "|="))):
    print(trial.tried(root, path, text, ["tests/oracle/test_found.py"], 20.0, Path("{log}")))
"""


@pytest.fixture
def root(tmp_path: Path) -> Path:
    """Return a folder with one module."""
    (tmp_path / "half.py").write_text(SOURCE)
    return tmp_path


def test_the_same_seed_draws_the_same_mutants_and_another_others(root: Path) -> None:
    first = sample(root, ["half.py"], 1, 12)
    assert len(set(first)) == 12
    assert first == sample(root, ["half.py"], 1, 12) != sample(root, ["half.py"], 2, 12)


def test_a_longer_sample_begins_with_the_shorter_so_that_it_goes_on(root: Path) -> None:
    assert sample(root, ["half.py"], 1, 12)[:5] == sample(root, ["half.py"], 1, 5)


def test_annotations_and_the_compiler_are_no_mutants(root: Path) -> None:
    everything = sample(root, ["half.py"], 1, 1000)
    assert {mutant.line for mutant in of_file(root, "half.py")} == {5, 6, 7, 10, 12}
    assert {mutant.line for mutant in everything} == {7, 10, 12}
    assert all(meaning(changed(SOURCE, mutant)) != meaning(SOURCE) for mutant in everything)


def test_a_place_that_an_edit_took_away_is_told() -> None:
    with pytest.raises(
        ValueError, match=r"half.py:7:3 core/NumberReplacer#90: there is no such place; sample anew"
    ):
        changed(SOURCE, Mutant("half.py", 7, 3, "core/NumberReplacer", 90))


@pytest.mark.parametrize(("line", "lines"), [(7, [7]), (9, [8, 9, 10, 11]), (12, [12]), (5, [5])])
def test_a_line_s_statement_is_the_innermost_and_of_a_compound_one_the_head(
    line: int, lines: list[int]
) -> None:
    assert list(statement(SOURCE, line)) == lines


@pytest.mark.bench
def test_a_mutant_in_a_kernel_s_helper_is_seen_by_the_kernels_that_call_it(tmp_path: Path) -> None:
    environment = dict(os.environ, NUMBA_DISABLE_JIT="1", OPENBLAS_NUM_THREADS="1")
    script = PLANTED.replace("{log}", str(tmp_path / "log"))
    run = subprocess.run(
        [sys.executable, "-c", script],
        env=environment,
        capture_output=True,
        text=True,
        check=False,
        timeout=200,
    )
    assert run.stdout.split() == ["survived", "killed"], run.stderr
