"""Allocator settings that keep freed memory, so that a mapping window faults in no new pages."""

from __future__ import annotations

import ctypes

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
