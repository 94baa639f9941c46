"""Memory that came and went stays with the process, so that a window needs no new pages of the system."""

from __future__ import annotations

import ctypes

# Of mallopt(3). Larger arrays than glibc's 128 KiB come from the heap (no glibc takes more than 32 MiB), all
# threads share it, and so much of it is kept.
FROM_HEAP_BYTES, KEPT_BYTES = 32 << 20, 128 << 20
M_TRIM_THRESHOLD, M_MMAP_THRESHOLD, M_ARENA_MAX = -1, -3, -8
OPTIONS = ((M_MMAP_THRESHOLD, FROM_HEAP_BYTES), (M_TRIM_THRESHOLD, KEPT_BYTES), (M_ARENA_MAX, 1))
# The same for a process to be started.
ENVIRONMENT = {"MALLOC_MMAP_THRESHOLD_": FROM_HEAP_BYTES, "MALLOC_TRIM_THRESHOLD_": KEPT_BYTES}


def keep_memory() -> bool:
    """Tell the C library's allocator; False where it cannot be told (it is not glibc's).

    Call it before other threads allocate. What is kept is what a window took at most, some 30 MB.
    """
    try:
        mallopt = ctypes.CDLL(None).mallopt
    except (OSError, AttributeError, TypeError):
        return False
    return all(mallopt(option, value) == 1 for option, value in OPTIONS)
