"""Real-time scheduling: used where allowed, for one thread, and given back."""

from __future__ import annotations

import os
import sys
from typing import Any

import pytest

from companion.runtime.priority import SWITCH_S, real_time_priority


def test_the_class_and_the_switch_interval_are_given_back(monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[int] = []
    monkeypatch.setattr(os, "sched_setscheduler", lambda _pid, policy, _param: asked.append(policy))
    before = sys.getswitchinterval()
    with real_time_priority() as allowed:
        assert allowed
        assert sys.getswitchinterval() == pytest.approx(SWITCH_S)
    assert asked == [os.SCHED_RR | os.SCHED_RESET_ON_FORK, os.sched_getscheduler(0)]
    assert sys.getswitchinterval() == before


def test_where_it_is_not_allowed_everything_stays_as_it_is(monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_: Any) -> None:
        raise PermissionError

    monkeypatch.setattr(os, "sched_setscheduler", refuse)
    before = sys.getswitchinterval()
    with real_time_priority() as allowed:
        assert not allowed
        assert sys.getswitchinterval() == before
