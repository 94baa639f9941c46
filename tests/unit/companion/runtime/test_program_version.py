"""Version of the program: a digest of its source."""

from __future__ import annotations

from pathlib import Path

from companion.runtime.program_version import program_version, source_digest
from tests import REPOSITORY


def source(root: Path, **files: str) -> Path:
    for name, text in files.items():
        path = root / (name.replace("__", "/") + ".py")
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text, "utf-8")
    return root


def test_it_is_the_release_and_the_digest_of_this_source() -> None:
    release, _, digest = program_version().partition("+")
    assert release[0].isdigit()
    assert digest == source_digest(REPOSITORY)


def test_a_changed_renamed_or_further_file_of_any_package_is_another_version(tmp_path: Path) -> None:
    digests = [
        source_digest(source(tmp_path / str(k), **files))
        for k, files in enumerate(
            [
                {"slz__a": "1", "sitl__b": "2"},
                {"slz__a": "1", "sitl__b": "3"},
                {"slz__a": "1", "sitl__c": "2"},
                {"slz__a": "1", "sitl__b": "2", "params__c": ""},
            ]
        )
    ]
    assert len(set(digests)) == 4


def test_compiled_files_and_the_safety_case_itself_are_left_out(tmp_path: Path) -> None:
    plain = source_digest(source(tmp_path / "a", slz__a="1"))
    more = {"companion__desk__evidence__x": "2", "tests__b": "3"}
    other = source(tmp_path / "b", slz__a="1", **more)
    (other / "slz" / "__pycache__").mkdir()
    (other / "slz" / "__pycache__" / "a.pyc").write_bytes(b"4")
    assert source_digest(other) == plain
