"""Inverse kinematics beside PyBullet's own, and the computation of whole motions of HIRO's arms.

Poses are those of random postures within the limits, half for each arm; both methods get the same
poses, one after the other. A pose counts as solved within 1 mm and 0.5 degrees, inside the limits.
Warm: each point of straight lines of 0.15 m from the point before. Motions are the random
manipulations of `./cell check-motion` that can be carried out, with one hand or two. Inverse
kinematics is timed in time of the process, since other work may run beside; motions in that and in
time of the wall clock. PyBullet gets a model with all other joints fixed and one try without
limits: with its null-space limits it solved none of 100.
"""

from __future__ import annotations

import statistics
import time
import xml.etree.ElementTree as ET
from collections.abc import Callable
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pybullet
from rich.console import Console
from rich.progress import track
from scipy.spatial.transform import Rotation

from emd_arm_executor.kinematics import ArmKinematics
from emd_arm_executor.motion_planner import MotionPlanner
from emd_arm_executor.path_following import follow_poses
from emd_arm_executor.robot_description import hiro_description
from emd_arm_executor.robot_model import RobotModel
from emd_cell.bench import BenchmarkResult
from emd_cell.motion_check.random_tasks import random_task
from emd_core.errors import CellError
from emd_core.frames import FloatArray

POSES = 10_000
POSES_PYBULLET = 300
LINES = 10
MOTIONS = 60
SEED = 11


class PyBulletArm:
    """PyBullet's damped least squares for one arm, from the middle of the joints' ranges."""

    def __init__(self, client: int, arm: ArmKinematics, robot: RobotModel, folder: Path) -> None:
        """Load the URDF with all joints fixed but the arm's."""
        self._client, self._arm = client, arm
        tree = ET.parse(robot.description.urdf)
        for joint in tree.getroot().findall("joint"):
            if joint.get("name") not in arm.group.joint_names:
                joint.set("type", "fixed")
        path = folder / f"{arm.name}.urdf"
        tree.write(path)
        self._body = pybullet.loadURDF(str(path), useFixedBase=True, physicsClientId=client)
        count = pybullet.getNumJoints(self._body, physicsClientId=client)
        infos = [
            pybullet.getJointInfo(self._body, i, physicsClientId=client) for i in range(count)
        ]
        index = {info[1].decode(): info[0] for info in infos}
        self._index = [index[name] for name in arm.group.joint_names]
        self._tool = next(i[0] for i in infos if i[12].decode() == arm.group.tool_frame)

    def solve(self, target: FloatArray, start: FloatArray) -> FloatArray:
        """Give joint positions (n,) for a pose (4, 4), from a start (n,)."""
        for index, position in zip(self._index, start, strict=True):
            pybullet.resetJointState(self._body, index, position, physicsClientId=self._client)
        found = pybullet.calculateInverseKinematics(
            self._body,
            self._tool,
            target[:3, 3].tolist(),
            Rotation.from_matrix(target[:3, :3]).as_quat().tolist(),
            maxNumIterations=200,
            residualThreshold=1e-6,
            physicsClientId=self._client,
        )
        return np.asarray(found)


def run() -> BenchmarkResult:
    """Measure poses, lines and motions."""
    robot = RobotModel(hiro_description())
    client = pybullet.connect(pybullet.DIRECT)
    try:
        with TemporaryDirectory() as folder:
            rivals = {
                name: PyBulletArm(client, arm, robot, Path(folder))
                for name, arm in robot.arms.items()
            }
        cold, warm = _cold(robot, rivals), _warm(robot, rivals)
    finally:
        pybullet.disconnect(client)
    motions = _motions(robot)
    rows = [*cold, *warm, *motions]
    by = {(row["what"], row["method"]): row for row in rows}
    summary = {
        "solved_of_10000": by["reachable poses", "ours"]["solved"],
        "cold_pybullet_over_ours": by["reachable poses", "pybullet"]["p50_us"]
        / by["reachable poses", "ours"]["p50_us"],
        "warm_p50_us": by["points on lines", "ours"]["p50_us"],
        "warm_pybullet_over_ours": by["points on lines", "pybullet"]["p50_us"]
        / by["points on lines", "ours"]["p50_us"],
        "motion_p50_ms": by["motion, all", "ours"]["p50_ms"],
        "motion_cpu_p50_ms": by["motion, all", "ours"]["cpu_p50_ms"],
    }
    config = {
        "poses": POSES,
        "poses_pybullet": POSES_PYBULLET,
        "lines": LINES,
        "motions": MOTIONS,
        "seed": SEED,
    }
    return BenchmarkResult(config, rows, summary)


def _cold(robot: RobotModel, rivals: dict[str, PyBulletArm]) -> list[dict]:
    rng = np.random.default_rng(SEED)
    ours, theirs = [], []
    for name, arm in robot.arms.items():
        middle = (arm.lower + arm.upper) / 2.0
        count = POSES // len(robot.arms)
        targets = arm.chain.forward(rng.uniform(arm.lower, arm.upper, (count, len(arm.lower))))
        arm.solve(targets[0], middle)  # loads the kernels
        for i, target in enumerate(track(targets, f"{name} arm", console=Console(stderr=True))):
            ours.append(_timed(arm, target, lambda: _solve(arm, target, middle)))  # noqa: B023
            if i < POSES_PYBULLET // len(robot.arms):
                rival = rivals[name]
                theirs.append(_timed(arm, target, lambda: rival.solve(target, middle)))  # noqa: B023
    return [
        _ik_row("reachable poses", "ours", ours),
        _ik_row("reachable poses", "pybullet", theirs),
    ]


def _warm(robot: RobotModel, rivals: dict[str, PyBulletArm]) -> list[dict]:
    arm, rival = robot.arms["left"], rivals["left"]
    start = np.deg2rad([0.6, 0.0, -100.0, -15.2, 9.4, -3.2])
    poses = np.repeat(arm.forward(start)[None], 60, axis=0)
    poses[:, 1, 3] += np.linspace(0.0, 0.15, 60)
    ours, theirs = [], []
    for _ in range(LINES):
        began = time.process_time()
        path = follow_poses(arm, poses, start)
        each = (time.process_time() - began) / len(poses)
        ours += [(each, _fits(arm, pose, q)) for pose, q in zip(poses, path, strict=True)]
        q = start
        for pose in poses:
            began = time.process_time()
            q = rival.solve(pose, q)
            theirs.append((time.process_time() - began, _fits(arm, pose, q)))
    return [
        _ik_row("points on lines", "ours", ours),
        _ik_row("points on lines", "pybullet", theirs),
    ]


def _motions(robot: RobotModel) -> list[dict]:
    planner, rest = MotionPlanner(robot), dict(robot.description.rest)
    found: list[tuple[int, float, float]] = []
    for index in track(range(MOTIONS), "motions", console=Console(stderr=True)):
        task = random_task(SEED, index)
        began, worked = time.perf_counter(), time.process_time()
        try:
            planner.plan_motion(task.manipulation, task.silhouette, rest)
        except CellError:
            continue
        times = (time.perf_counter() - began, time.process_time() - worked)
        found.append((int(sum(task.manipulation.used)), *times))
    groups = {"all": found} | {
        f"{hands} hand{'s' * (hands > 1)}": [f for f in found if f[0] == hands] for hands in (1, 2)
    }
    return [
        {
            "what": f"motion, {name}",
            "method": "ours",
            "count": len(group),
            "p50_ms": 1e3 * statistics.median(wall for _, wall, _ in group),
            "p95_ms": 1e3 * float(np.percentile([wall for _, wall, _ in group], 95)),
            "cpu_p50_ms": 1e3 * statistics.median(cpu for _, _, cpu in group),
            "cpu_p95_ms": 1e3 * float(np.percentile([cpu for _, _, cpu in group], 95)),
        }
        for name, group in groups.items()
    ]


def _solve(arm: ArmKinematics, target: FloatArray, start: FloatArray) -> FloatArray | None:
    return next(arm.solutions(target, (start,)), None)


def _timed(
    arm: ArmKinematics, target: FloatArray, solve: Callable[[], FloatArray | None]
) -> tuple[float, bool]:
    began = time.process_time()
    found = solve()
    return time.process_time() - began, found is not None and _fits(arm, target, found)


def _fits(arm: ArmKinematics, target: FloatArray, positions: FloatArray) -> bool:
    if (positions < arm.lower - 1e-6).any() or (positions > arm.upper + 1e-6).any():
        return False
    pose = arm.forward(positions)
    turn = Rotation.from_matrix(pose[:3, :3].T @ target[:3, :3]).magnitude()
    near = np.linalg.norm(pose[:3, 3] - target[:3, 3]) < 1e-3
    return bool(near and turn < np.deg2rad(0.5))


def _ik_row(what: str, method: str, results: list[tuple[float, bool]]) -> dict:
    times = [1e6 * seconds for seconds, _ in results]
    return {
        "what": what,
        "method": method,
        "count": len(results),
        "solved": sum(solved for _, solved in results),
        "p50_us": statistics.median(times),
        "p95_us": float(np.percentile(times, 95)),
        "mean_us": statistics.mean(times),
    }
