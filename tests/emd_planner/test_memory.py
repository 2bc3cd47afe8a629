"""Memory kept for the next tensors."""

from __future__ import annotations

import subprocess
import sys

import pytest


def test_freed_memory_is_used_again_without_page_faults():
    """After the call, tensors of the same size as freed ones cost hardly any page fault."""
    if not sys.platform.startswith("linux"):
        pytest.skip("mallopt is a matter of glibc")
    script = """
import resource, sys
from emd_planner.memory import keep_freed_memory
if not keep_freed_memory():
    sys.exit(77)
import torch
faults = lambda: resource.getrusage(resource.RUSAGE_SELF).ru_minflt
counts = []
for _ in range(8):
    before = faults()
    torch.empty(2**24).fill_(1.0)
    counts.append(faults() - before)
print(min(counts[1:]))  # the kernel may take pages back at any time, but not every time
"""
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True)
    if done.returncode == 77:
        pytest.skip("this C library has no mallopt")
    assert done.returncode == 0, done.stderr
    assert int(done.stdout) < 1000  # 64 MiB would be 16384 pages
