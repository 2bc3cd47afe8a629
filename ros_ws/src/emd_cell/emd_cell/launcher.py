"""Starts every node as a process of its own, watches them, and stops them all.

The ROS 2 wheels come without `launch`, hence this one.
"""

from __future__ import annotations

import ctypes
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import yaml

from emd_core.errors import DeadlineError

_PR_SET_PDEATHSIG = 1


@dataclass(frozen=True)
class NodeSpec:
    """One node to run.

    Attributes:
        name: Name of the node.
        module: Python module with its `main`.
        parameters: ROS parameters that differ from the node's defaults; dots make groups.
        restart: Whether to start it again when it dies.
        namespace: Put before its relative names, or empty.
    """

    name: str
    module: str
    parameters: Mapping[str, Any] = field(default_factory=dict)
    restart: bool = True
    namespace: str = ""


@dataclass
class _Running:
    spec: NodeSpec
    process: subprocess.Popen[bytes]
    started: float
    failures: int = 0
    restart_at: float | None = None


class Launcher:
    """A context in which the given nodes run.

    Each node's output goes to `<log_directory>/<name>.log`. A node that dies is started again
    after 1 s, then 2 s, and so on up to 30 s; one that exits with status 2 has refused its
    parameters and is not tried again.
    """

    def __init__(
        self,
        specs: list[NodeSpec],
        log_directory: Path,
        on_event: Callable[[str], None] | None = None,
    ) -> None:
        """Prepare to run `specs`; `on_event` is told of starts, deaths and restarts."""
        self._specs = specs
        self._log_directory = log_directory
        self._on_event = on_event or (lambda text: None)
        self._running: dict[str, _Running] = {}

    def __enter__(self) -> Launcher:
        """Start every node."""
        self._log_directory.mkdir(parents=True, exist_ok=True)
        try:
            for spec in self._specs:
                self._running[spec.name] = _Running(spec, self._start(spec), time.monotonic())
        except BaseException:
            self.stop()
            raise
        return self

    def __exit__(self, *_: object) -> None:
        """Stop every node."""
        self.stop()

    def watch(self) -> list[str]:
        """Look after the nodes once; call it a few times a second.

        Returns:
            Names of the nodes that are dead and will not be started again.
        """
        return [name for name, running in self._running.items() if not self._look_after(running)]

    def log_tail(self, name: str, lines: int = 15) -> str:
        """The last lines that a node wrote."""
        file = self._log_directory / f"{name}.log"
        return "\n".join(file.read_text(errors="replace").splitlines()[-lines:])

    def require_alive(self) -> None:
        """Look after the nodes and complain of one that is gone for good.

        Raises:
            DeadlineError: If a node will not be started again, with the end of its log.
        """
        dead = self.watch()
        if dead:
            raise DeadlineError(
                f"node {dead[0]} does not run; its log ends with\n{self.log_tail(dead[0])}"
            )

    def process_id(self, name: str) -> int:
        """The process that runs a node."""
        return self._running[name].process.pid

    def stop(self, patience: float = 5.0) -> None:
        """Interrupt every node, then terminate, then kill those that do not go in time."""
        for stop_signal in (signal.SIGINT, signal.SIGTERM, signal.SIGKILL):
            alive = [
                item.process for item in self._running.values() if item.process.poll() is None
            ]
            for process in alive:
                process.send_signal(stop_signal)
            deadline = time.monotonic() + patience
            for process in alive:
                try:
                    process.wait(timeout=max(0.0, deadline - time.monotonic()))
                except subprocess.TimeoutExpired:
                    self._on_event(f"{process.pid} ignores {stop_signal.name}")
        self._running.clear()

    def _look_after(self, running: _Running) -> bool:
        """Restart a dead node when its time has come; False if it stays dead."""
        status = running.process.poll()
        now = time.monotonic()
        if status is None:
            return True
        if running.restart_at is None:
            lifetime = now - running.started
            refused = status == 2
            if refused or not running.spec.restart:
                return False
            running.failures = 1 if lifetime > 30 else running.failures + 1
            delay = min(2.0 ** (running.failures - 1), 30.0)
            running.restart_at = now + delay
            self._on_event(f"{running.spec.name} died (status {status}), restart in {delay:.0f} s")
        elif now >= running.restart_at:
            running.process, running.started = self._start(running.spec), now
            running.restart_at = None
        return True

    def _start(self, spec: NodeSpec) -> subprocess.Popen[bytes]:
        command = [sys.executable, "-m", spec.module, "--ros-args", "-r", f"__node:={spec.name}"]
        if spec.namespace:
            command += ["-r", f"__ns:={spec.namespace}"]
        if spec.parameters:
            file = self._log_directory / f"{spec.name}.yaml"
            full_name = f"{spec.namespace}/{spec.name}"
            parameters = {"ros__parameters": dict(spec.parameters)}
            file.write_text(yaml.safe_dump({full_name: parameters}))
            command += ["--params-file", str(file)]
        with open(self._log_directory / f"{spec.name}.log", "ab") as log:
            process = subprocess.Popen(
                command,
                stdin=subprocess.DEVNULL,
                stdout=log,
                stderr=subprocess.STDOUT,
                env={**os.environ, "PYTHONUNBUFFERED": "1"},
                start_new_session=True,  # Ctrl-C reaches the launcher alone, which stops them
                preexec_fn=_die_with_parent,
            )
        self._on_event(f"{spec.name} started (process {process.pid})")
        return process


def _die_with_parent() -> None:
    """Ask the kernel to interrupt this child when the launcher is killed."""
    ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGINT)
