"""Settings of this process: memory kept by the allocator, real-time scheduling of the event loop's thread."""

from __future__ import annotations

import ctypes
import logging
import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager

log = logging.getLogger(__name__)
REAL_TIME = 10
SWITCH_S = 5e-4
# mallopt(3) parameters. Arrays above glibc's default threshold of 128 KiB then come from the heap (glibc
# accepts at most 32 MiB), which all threads share, so that freed memory is reused.
FROM_HEAP_BYTES, KEPT_BYTES = 32 << 20, 128 << 20
M_TRIM_THRESHOLD, M_MMAP_THRESHOLD, M_ARENA_MAX = -1, -3, -8
OPTIONS = ((M_MMAP_THRESHOLD, FROM_HEAP_BYTES), (M_TRIM_THRESHOLD, KEPT_BYTES), (M_ARENA_MAX, 1))
# The same settings for a child process.
ENVIRONMENT = {"MALLOC_MMAP_THRESHOLD_": FROM_HEAP_BYTES, "MALLOC_TRIM_THRESHOLD_": KEPT_BYTES}


def keep_memory() -> bool:
    """Configure the C library's allocator; return False where it has no mallopt (it is not glibc's).

    Call before other threads allocate. The memory kept is the peak of one window, about 30 MB.
    """
    try:
        mallopt = ctypes.CDLL(None).mallopt
    except (OSError, AttributeError, TypeError):
        return False
    return all(mallopt(option, value) == 1 for option, value in OPTIONS)


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
