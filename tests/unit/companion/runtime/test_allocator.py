"""Memory pages, taken from the system once, not once a window."""

from __future__ import annotations

import platform
import subprocess
import sys

import pytest

CHURN = """
import resource, threading
import numpy as np
from companion.runtime.allocator import keep_memory

def churn():
    before = 0
    for n in range(40):
        if n == 10:
            before = resource.getrusage(resource.RUSAGE_SELF).ru_minflt
        arrays = [np.ones(400_000) for _ in range(4)]
    faults.append(resource.getrusage(resource.RUSAGE_SELF).ru_minflt - before)

faults, kept = [], keep_memory()
thread = threading.Thread(target=churn)
thread.start()
thread.join()
print(int(kept), *faults)
"""


@pytest.mark.skipif(platform.libc_ver()[0] != "glibc", reason="only glibc's allocator can be told")
def test_arrays_that_come_and_go_in_a_thread_take_no_new_pages() -> None:
    told = subprocess.run([sys.executable, "-c", CHURN], capture_output=True, text=True, check=True)
    kept, faults = map(int, told.stdout.split())
    assert kept == 1
    assert faults < 1000  # 4 x 3.2 MB in 30 rounds: 94,000 pages, were they given back each time
