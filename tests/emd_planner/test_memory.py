"""Memory kept for the next tensors, and threads that wait."""

from __future__ import annotations

import os
import subprocess
import sys

import pytest

SCRIPT = """
import resource, sys
from emd_planner.memory import keep_freed_memory
if not keep_freed_memory():
    sys.exit(77)
import torch
from emd_planner.net_config import EmdNetConfig
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


WAITING = """
import os, sys
import emd_planner.planning_net
assert "torch" in sys.modules
print(os.environ["OMP_WAIT_POLICY"], os.environ.get("GOMP_SPINCOUNT"))
"""


@pytest.mark.parametrize(("asked", "wanted"), [(None, "PASSIVE 3000"), ("ACTIVE", "ACTIVE None")])
def test_waiting_threads_soon_sleep_unless_the_user_says_otherwise(asked, wanted) -> None:
    """Set before PyTorch reads it."""
    ours = ("OMP_WAIT_POLICY", "GOMP_SPINCOUNT")
    environment = {name: value for name, value in os.environ.items() if name not in ours}
    if asked is not None:
        environment["OMP_WAIT_POLICY"] = asked
    environment["PYTHONPATH"] = os.pathsep.join(sys.path)
    command = [sys.executable, "-c", WAITING]
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=True)
    assert done.stdout.strip() == wanted
