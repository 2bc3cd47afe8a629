"""Memory kept for the next tensors."""

from __future__ import annotations

import subprocess
import sys

import pytest

SCRIPT = """
import resource, sys
from emd_planner.memory import keep_freed_memory
if not keep_freed_memory():
    sys.exit(77)
import torch
from emd_planner.config import EmdNetConfig
from emd_planner.emd_net import EmdNet
torch.set_num_threads(1)
net = EmdNet(EmdNetConfig(), seed=0)
counts = []
for _ in range(7):
    before = resource.getrusage(resource.RUSAGE_SELF).ru_minflt
    net.predict(torch.zeros(16, 32, 32, 16), torch.zeros(16, 1, 6)).mean().backward()
    net.zero_grad()
    counts.append(resource.getrusage(resource.RUSAGE_SELF).ru_minflt - before)
print(min(counts[3:]))  # the first steps find the places for tensors of each size
"""


def test_training_steps_hardly_fault_pages() -> None:
    """After a few steps the next one uses the memory of the last; without the call: 10,000."""
    if not sys.platform.startswith("linux"):
        pytest.skip("mallopt is a matter of glibc")
    done = subprocess.run([sys.executable, "-c", SCRIPT], capture_output=True, text=True)
    if done.returncode == 77:
        pytest.skip("this C library has no mallopt")
    assert done.returncode == 0, done.stderr
    assert int(done.stdout) < 1000
