"""Context of a part of the record: a folder, and a store for its answers."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

from tests.answers.decoding import decoded_folder
from tests.answers.store import Store
from tests.answers.tree import Tree
from tests.answers.variable import normalised


@dataclass
class Recorder:
    """Takes the answers of one part.

    work: empty folder for files on the way. full: whole workloads, however long they take. skipped: what was
    left out, one line each.
    """

    part: str
    work: Path
    store: Store
    full: bool = False
    skipped: list[str] = field(default_factory=list)

    def add(self, name: str, tree: Tree) -> None:
        """Store an answer of this part without what must differ from run to run."""
        whole = f"{self.part}/{name}"
        self.store.add(self.part, whole, normalised(whole, tree, {self.work: "WORK"}))

    def add_folder(self, name: str, folder: Path) -> None:
        """Store every file below a folder as an answer of its own."""
        for file, tree in decoded_folder(folder).items():
            self.add(f"{name}/{file}", tree)

    def skip(self, line: str) -> None:
        """Say in one line what is left out, and why."""
        self.skipped.append(line)
        print(f"answers: {self.part}: left out: {line}", flush=True)
