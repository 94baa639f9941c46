"""Memory that came and went stays with the process, so that a window needs no new pages of the system."""

from __future__ import annotations

import ctypes

MIB = 1 << 20
# mallopt(3). Larger arrays than glibc's 128 KiB come from the heap, all threads share it, and it is kept.
M_TRIM_THRESHOLD, M_MMAP_THRESHOLD, M_ARENA_MAX = -1, -3, -8
OPTIONS = ((M_MMAP_THRESHOLD, 32 * MIB), (M_TRIM_THRESHOLD, 256 * MIB), (M_ARENA_MAX, 1))


def keep_memory() -> bool:
    """Tell the C library's allocator; False where it cannot be told (it is not glibc's).

    Call it before other threads allocate. What is kept is what a window took at most, some 30 MB.
    """
    try:
        mallopt = ctypes.CDLL(None).mallopt
    except (OSError, AttributeError, TypeError):
        return False
    return all(mallopt(option, value) == 1 for option, value in OPTIONS)
