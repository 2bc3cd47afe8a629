"""The set-up by `./cell`: what it redoes, what it refuses, what survives a kill."""

import subprocess
import sys
import textwrap
from pathlib import Path
from types import ModuleType

import pytest

ROOT = Path(__file__).parents[2]
STAGES = ("create_venv", "install_packages", "repair_cmake_files", "build_workspace")


def load_cell() -> ModuleType:
    """The bootstrap as a module; its name has no `.py`."""
    module = ModuleType("cell_bootstrap")
    module.__file__ = str(ROOT / "cell")
    exec(compile((ROOT / "cell").read_text(), module.__file__, "exec"), module.__dict__)
    return module


@pytest.fixture
def cell(tmp_path, monkeypatch) -> ModuleType:
    """The bootstrap on an empty checkout, its stages replaced by notes in `cell.done`."""
    module = load_cell()
    venv = tmp_path / ".venv"
    monkeypatch.setattr(module, "ROOT", tmp_path)
    monkeypatch.setattr(module, "VENV", venv)
    monkeypatch.setattr(module, "WORKSPACE", tmp_path / "ros_ws")
    for name, file in (("STATE", "state"), ("LOG", "log"), ("BUILDING", "building")):
        monkeypatch.setattr(module, name, venv / file)
    (tmp_path / "requirements.lock").write_text("numpy==2.4.6\n")
    module.done = []
    module.real_build = module.build_workspace
    for name in STAGES:
        stage = note_stage(module.done, name)
        monkeypatch.setattr(module, name, stage)
    monkeypatch.setattr(module, "missing_system_packages", lambda: [])
    return module


def note_stage(done: list[str], name: str):
    """A stage that only notes that it ran."""

    def stage() -> None:
        done.append(name)

    stage.__name__ = name
    return stage


def test_finished_stages_are_not_redone(cell):
    """A second set-up does nothing."""
    cell.set_up()
    cell.set_up()
    assert cell.done == list(STAGES)


def test_a_changed_lock_reinstalls_and_rebuilds(cell):
    """New pins are installed into the environment that is there, and the workspace is rebuilt."""
    cell.set_up()
    (cell.ROOT / "requirements.lock").write_text("numpy==2.5.0\n")
    cell.done.clear()
    cell.set_up()
    assert cell.done == list(STAGES[1:])


def test_an_interrupted_install_starts_from_an_empty_environment(cell, monkeypatch):
    """A pip that did not end well is not trusted with what it left behind."""

    def killed() -> None:
        raise cell.SetupError("killed")

    killed.__name__ = "install_packages"
    whole = cell.install_packages
    monkeypatch.setattr(cell, "install_packages", killed)
    with pytest.raises(cell.SetupError):
        cell.set_up()
    monkeypatch.setattr(cell, "install_packages", whole)
    cell.done.clear()
    cell.set_up()
    assert cell.done == list(STAGES)


def test_a_moved_checkout_is_set_up_anew(cell, monkeypatch, tmp_path):
    """The environment's scripts name its directory, so it cannot move along."""
    cell.set_up()
    moved = tmp_path / "moved"
    moved.mkdir()
    (tmp_path / "requirements.lock").rename(moved / "requirements.lock")
    monkeypatch.setattr(cell, "ROOT", moved)
    cell.done.clear()
    cell.set_up()
    assert cell.done == list(STAGES)


def test_missing_packages_are_named_in_one_command_and_nothing_is_left(cell, monkeypatch):
    """Without root the set-up tells the apt command and does not begin."""
    monkeypatch.setattr(cell, "missing_system_packages", lambda: ["g++", "libgl1"])
    monkeypatch.setattr(cell, "may_install_system_packages", lambda: False)
    with pytest.raises(cell.SetupError, match=r"sudo apt-get install -y .* g\+\+ libgl1\n"):
        cell.set_up()
    assert not cell.VENV.exists()
    assert cell.done == []


def test_a_build_that_was_killed_is_dropped(cell, monkeypatch):
    """Objects that a killed compiler left are removed; those of a failed build stay."""
    made = cell.WORKSPACE / "build" / "emd_msgs_py" / "half.o"
    made.parent.mkdir(parents=True)
    made.touch()
    cell.VENV.mkdir()
    found = []

    def colcon(*_) -> None:
        found.append(made.exists())
        raise cell.SetupError("does not compile")

    monkeypatch.setattr(cell, "run_logged", colcon)
    for _ in range(2):
        with pytest.raises(cell.SetupError):
            cell.real_build()
    cell.BUILDING.touch()
    with pytest.raises(cell.SetupError):
        cell.real_build()
    assert found == [True, True, False]


def test_the_python_of_the_environment_is_kept(cell):
    """Commands go on under the Python that `.venv` was made from while that works."""
    settings = cell.VENV / "pyvenv.cfg"
    assert cell.environment_python() is None
    cell.VENV.mkdir()
    settings.write_text(f"home = /usr/bin\nexecutable = {cell.base_python()}\n")
    assert cell.environment_python() == cell.base_python()
    settings.write_text("executable = /nowhere/python3.11\n")
    assert cell.environment_python() is None
    settings.write_text("executable = /bin/false\n")
    assert cell.environment_python() is None


def test_a_child_keeps_the_lock_of_a_set_up_that_was_killed(tmp_path):
    """A second set-up waits for a pip that outlived the first."""
    source = textwrap.dedent(
        f"""
        import sys
        from pathlib import Path
        sys.path.insert(0, {str(Path(__file__).parent)!r})
        from test_bootstrap import load_cell
        cell = load_cell()
        cell.LOG = Path("log")
        lock = open("lock", "w")
        cell.take_turn(lock.fileno())
        print("turn", flush=True)
        if sys.argv[1] == "first":
            child = "import os, signal, time; os.kill(os.getppid(), signal.SIGKILL); time.sleep(2)"
            cell.run_logged([sys.executable, "-S", "-c", child])
        """
    )
    command = [sys.executable, "-W", "ignore", "-c", source]
    first = subprocess.run([*command, "first"], cwd=tmp_path, capture_output=True, text=True)
    second = subprocess.run([*command, "second"], cwd=tmp_path, capture_output=True, text=True)
    assert first.returncode == -9
    assert second.stdout.splitlines() == [
        "Waiting for another set-up of this checkout to end",
        "turn",
    ]
