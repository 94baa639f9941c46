"""Digests of every bit."""

from __future__ import annotations

import math

import numpy as np

from slz.grid import Grid
from tests.golden.bits import digests


def test_one_bit_or_a_type_changes_a_digest_and_only_its_own() -> None:
    grid = Grid(-40.0, -40.0, 1.0, 80, 80)
    thing = {"a": [np.array([1.0, math.nan]), grid], "b": ("safe", None, 3)}
    found = digests(thing)
    assert digests(thing) == found
    assert {"[a][0]", "[b][0]", "[b][1]", "[b][2]"} < set(found)
    for place, other in (
        ("[a][0]", {"a": [np.array([np.nextafter(1.0, 2.0), math.nan]), grid], "b": thing["b"]}),
        ("[a][0]", {"a": [np.array([1.0, math.nan], np.float32), grid], "b": thing["b"]}),
        ("[b][2]", {"a": thing["a"], "b": ("safe", None, 4)}),
    ):
        changed = digests(other)
        assert {name for name in found if changed[name] != found[name]} == {place}


def test_a_nan_has_the_same_digest_whatever_its_sign() -> None:
    assert digests(np.array([math.nan])) == digests(np.array([-math.nan])) != digests(np.array([0.0]))
