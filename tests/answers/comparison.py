"""Comparison of two records."""

from __future__ import annotations

from collections.abc import Iterator

from tests.answers.differences import differences, grouped
from tests.answers.store import Store
from tests.answers.tree import digest


def compared(before: Store, after: Store) -> Iterator[str]:
    """Yield one line for each kind of difference: answer, key path, and what is different there.

    Only answers whose digests differ are read. A part that only one record holds, that failed or that left
    something out in one of them alone is a difference, and so is a record without any answer.
    """
    yield from _parts(before, after)
    ours, theirs = before.digests, after.digests
    for store in (before, after):
        if not store.digests:
            yield f"{store.folder}: holds no answers"
    for name, sha256 in ours.items():
        if name not in theirs:
            yield f"{name}: missing after"
        elif theirs[name] != sha256:
            yield from _answer(name, before, after)
    for name in theirs:
        if name not in ours:
            yield f"{name}: added"


def _parts(before: Store, after: Store) -> Iterator[str]:
    ours, theirs = before.manifest["parts"], after.manifest["parts"]
    for part in sorted({*ours, *theirs}):
        if part not in ours or part not in theirs:
            yield f"{part}: recorded only {'after' if part in theirs else 'before'}"
            continue
        for when, said in (("before", ours[part]), ("after", theirs[part])):
            if said["failed"]:
                yield f"{part}: failed {when}"
        if ours[part].get("skipped") != theirs[part].get("skipped"):
            yield f"{part}: left out {ours[part].get('skipped')} before, {theirs[part].get('skipped')} after"


def _answer(name: str, before: Store, after: Store) -> Iterator[str]:
    trees = []
    for when, store in (("before", before), ("after", after)):
        try:
            tree = store.read(name)
        except (OSError, KeyError, ValueError) as error:
            yield f"{name}: cannot be read {when}: {error}"
            return
        if digest(tree) != store.digests[name]:
            yield f"{name}: its file {when} does not fit the manifest"
            return
        trees.append(tree)
    lines = [f"{name}: {line}" for line in grouped(differences(*trees))]
    yield from lines or [f"{name}: digests differ"]
