"""Real-time scheduling of the event loop's thread, so that the streams stay steady on a busy computer."""

from __future__ import annotations

import logging
import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager

log = logging.getLogger(__name__)

REAL_TIME = 10
SWITCH_S = 5e-4


@contextmanager
def real_time_priority() -> Iterator[bool]:
    """Run this thread in the real-time class; yield whether the system allowed it.

    Threads and processes started within get the ordinary class. Python's switch interval becomes 0.5 ms
    instead of 5 ms, because a thread in the real-time class still waits for the interpreter lock.
    """
    policy, parameter, switch_s = os.sched_getscheduler(0), os.sched_getparam(0), sys.getswitchinterval()
    try:
        os.sched_setscheduler(0, os.SCHED_RR | os.SCHED_RESET_ON_FORK, os.sched_param(REAL_TIME))
    except PermissionError:
        log.info("no real-time priority: on a busy computer the streams will jitter (CAP_SYS_NICE allows it)")
        yield False
        return
    sys.setswitchinterval(SWITCH_S)
    try:
        yield True
    finally:
        sys.setswitchinterval(switch_s)
        os.sched_setscheduler(0, policy, parameter)
