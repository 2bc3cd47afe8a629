"""What is read of other processes agrees with what they did."""

import subprocess
import sys
import time

import pytest

from emd_cell.process_figures import cpu_seconds, descendants, memory_mb

BUSY = """
import subprocess, sys, time
kept = bytearray(b"x" * 80_000_000)
while time.process_time() < 0.5:
    pass
waiting = [sys.executable, "-c", "import sys; sys.stdin.read()"]
child = subprocess.Popen(waiting, stdin=subprocess.PIPE)
print(child.pid, time.process_time(), flush=True)
sys.stdin.read()
"""


def test_a_process_that_worked_grew_and_had_a_child() -> None:
    """Its own word for the time it took, its memory, and its child."""
    with subprocess.Popen(
        [sys.executable, "-c", BUSY], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    ) as process:
        child, used = process.stdout.readline().split()
        assert cpu_seconds(process.pid) == pytest.approx(float(used), abs=0.1)
        assert 80.0 < memory_mb(process.pid) < 160.0
        assert descendants(process.pid) == [int(child)]
        process.kill()
    with pytest.raises(FileNotFoundError):
        cpu_seconds(process.pid)
    deadline = time.monotonic() + 30
    while descendants(process.pid):
        assert time.monotonic() < deadline
