"""The launcher: processes that start, die, come back, and all go away."""

import os
import subprocess
import sys
import time
from pathlib import Path

import pytest

from emd_cell.launcher import Launcher, NodeSpec
from emd_core.errors import DeadlineError

STEADY = "import time\nprint('alive', flush=True)\ntime.sleep(60)\n"
DYING = "import sys, time\nprint('dying', flush=True)\nsys.exit(3)\n"
REFUSING = "import sys\nprint('wrong parameter', file=sys.stderr)\nsys.exit(2)\n"
STUBBORN = (
    "import signal, time\nsignal.signal(signal.SIGINT, signal.SIG_IGN)\n"
    "signal.signal(signal.SIGTERM, signal.SIG_IGN)\nprint('deaf', flush=True)\ntime.sleep(60)\n"
)


@pytest.fixture
def module(tmp_path, monkeypatch):
    """Make a module that stands for a node."""
    monkeypatch.setenv("PYTHONPATH", f"{tmp_path}:{os.environ.get('PYTHONPATH', '')}")

    def make(name: str, source: str) -> str:
        (tmp_path / f"{name}.py").write_text(source)
        return name

    return make


def wait_until(condition, launcher: Launcher, seconds: float = 20.0) -> None:
    """Watch until a condition holds."""
    deadline = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < deadline, "it did not happen in time"
        launcher.watch()
        time.sleep(0.05)


def is_running(process_id: int) -> bool:
    """Whether a process exists and is no zombie."""
    status = Path(f"/proc/{process_id}/stat")
    return status.exists() and status.read_text().rpartition(")")[2].split()[0] != "Z"


def test_a_node_that_dies_is_started_again(module, tmp_path) -> None:
    """Its log then holds its first words twice."""
    spec = NodeSpec("dying", module("dying_node", DYING))
    with Launcher([spec], tmp_path / "logs") as launcher:
        wait_until(lambda: launcher.log_tail("dying").count("dying") >= 2, launcher)


def test_a_node_that_refuses_its_parameters_is_not_tried_again(module, tmp_path) -> None:
    """Status 2 means that trying again cannot help; the log's end is in the error."""
    spec = NodeSpec("refusing", module("refusing_node", REFUSING))
    with Launcher([spec], tmp_path / "logs") as launcher:
        wait_until(lambda: launcher.watch() == ["refusing"], launcher)
        with pytest.raises(DeadlineError, match="wrong parameter"):
            launcher.require_alive()


def test_a_killed_node_comes_back_with_another_process(module, tmp_path) -> None:
    """The cell survives the loss of a node."""
    spec = NodeSpec("steady", module("steady_node", STEADY))
    with Launcher([spec], tmp_path / "logs") as launcher:
        wait_until(lambda: "alive" in launcher.log_tail("steady"), launcher)
        first = launcher.process_id("steady")
        os.kill(first, 9)
        wait_until(lambda: launcher.process_id("steady") != first, launcher)
        wait_until(lambda: launcher.log_tail("steady").count("alive") == 2, launcher)


def test_leaving_stops_even_nodes_that_ignore_it(module, tmp_path) -> None:
    """No process outlives the launcher's context."""
    specs = [
        NodeSpec("steady", module("steady_node", STEADY)),
        NodeSpec("stubborn", module("stubborn_node", STUBBORN)),
    ]
    with Launcher(specs, tmp_path / "logs") as launcher:
        wait_until(lambda: "deaf" in launcher.log_tail("stubborn"), launcher)
        processes = [launcher.process_id(spec.name) for spec in specs]
        launcher.stop(patience=0.3)
    assert not any(is_running(process) for process in processes)


def test_nodes_go_when_their_launcher_is_killed(module, tmp_path) -> None:
    """A launcher that dies by SIGKILL leaves no orphans behind."""
    script = (
        "import sys, time\nfrom pathlib import Path\n"
        "from emd_cell.launcher import Launcher, NodeSpec\n"
        "with Launcher([NodeSpec('steady', 'steady_node')], Path(sys.argv[1])) as launcher:\n"
        "    print(launcher.process_id('steady'), flush=True)\n"
        "    time.sleep(60)\n"
    )
    module("steady_node", STEADY)
    parent = subprocess.Popen(
        [sys.executable, "-c", script, str(tmp_path / "logs")], stdout=subprocess.PIPE, text=True
    )
    assert parent.stdout is not None
    child = int(parent.stdout.readline())
    assert is_running(child)
    parent.kill()
    parent.wait()
    deadline = time.monotonic() + 10
    while is_running(child) and time.monotonic() < deadline:
        time.sleep(0.05)
    assert not is_running(child)


def test_parameters_reach_the_node_as_a_ros_parameter_file(module, tmp_path) -> None:
    """Values are handed over in the form that every ROS node reads."""
    printing = (
        "import sys\nprint(open(sys.argv[-1]).read(), flush=True)\nimport time\ntime.sleep(60)\n"
    )
    spec = NodeSpec("camera", module("printing_node", printing), {"gain.red": 0.5}, namespace="/a")
    with Launcher([spec], tmp_path / "logs") as launcher:
        wait_until(lambda: "gain.red: 0.5" in launcher.log_tail("camera"), launcher)
        assert "/a/camera:" in launcher.log_tail("camera")
