"""Folder of recorded answers: a manifest with their digests, and the answers themselves."""

from __future__ import annotations

import gzip
import json
from pathlib import Path
from typing import Any

import numpy as np

from tests.answers.tree import Tree, digest, packed, unpacked

MANIFEST = "manifest.json"


class Store:
    """Answers by name in a folder: `NAME.json.gz` each, and `NAME.npz` where it holds arrays.

    The manifest is written after every answer, so that a record that is broken off keeps what it has.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        path = folder / MANIFEST
        self.manifest: dict[str, Any] = (
            json.loads(path.read_text("utf-8")) if path.is_file() else {"answers": {}, "parts": {}}
        )

    @property
    def digests(self) -> dict[str, str]:
        """Digests by the answers' names."""
        return {name: entry["sha256"] for name, entry in self.manifest["answers"].items()}

    def add(self, part: str, name: str, tree: Tree) -> None:
        """Write an answer of a part of the record."""
        arrays: list[Any] = []
        text = json.dumps(packed(tree, arrays), allow_nan=False)
        path = self._path(name, ".json.gz")
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(gzip.compress(text.encode(), mtime=0))
        if arrays:
            named = {f"a{k}": array for k, array in enumerate(arrays)}
            np.savez_compressed(self._path(name, ".npz"), **named)
        self.manifest["answers"][name] = {"part": part, "sha256": digest(tree)}
        self._write()

    def forget(self, part: str) -> None:
        """Remove a part's answers, before it is recorded again."""
        for name in [name for name, entry in self.manifest["answers"].items() if entry["part"] == part]:
            del self.manifest["answers"][name]
            for ending in (".json.gz", ".npz"):
                self._path(name, ending).unlink(missing_ok=True)
        self.manifest["parts"].pop(part, None)

    def finish(self, part: str, **said: Any) -> None:
        """Note that a part is complete, what it cost, and what it left out."""
        self.manifest["parts"][part] = said
        self._write()

    def read(self, name: str) -> Tree:
        """Return an answer.

        Raises
        ------
        OSError
            Its files are missing.
        """
        tree = json.loads(gzip.decompress(self._path(name, ".json.gz").read_bytes()))
        path, arrays = self._path(name, ".npz"), []
        if path.is_file():
            with np.load(path, allow_pickle=False) as file:
                arrays = [file[f"a{k}"] for k in range(len(file.files))]
        return unpacked(tree, arrays)

    def _path(self, name: str, ending: str) -> Path:
        return self.folder / (name + ending)

    def _write(self) -> None:
        self.folder.mkdir(parents=True, exist_ok=True)
        text = json.dumps(self.manifest, indent=1, sort_keys=True)
        (self.folder / MANIFEST).write_text(text + "\n", "utf-8")
