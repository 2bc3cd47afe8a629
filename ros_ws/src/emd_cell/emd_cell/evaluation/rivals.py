"""The planners that are compared, trivial ones among them."""

from __future__ import annotations

import math
import time
from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np

from emd_core.errors import InvalidInputError, NoPlanError, SimulationError
from emd_core.frames import FloatArray
from emd_core.manipulation import Manipulation
from emd_core.metrics import voxel_mse
from emd_core.voxel_grid import VoxelGrid
from emd_planner.config import PLANNERS, PlannerConfig, ReachConfig
from emd_planner.fold_plan import FoldPlan
from emd_planner.memory import keep_freed_memory
from emd_planner.plan import alternatives
from emd_planner.state_predictor import StatePredictor
from emd_planner.trust import PlanFigures
from emd_planner.weights import load_net

TRIVIAL = ("nothing", "empty", "random", "oracle", "oracle_perturbed")
# Tries the best plans of "ours" in the simulation that will execute them: it borrows the truth.
SIMULATED = "ours-simulated"
RIVALS = (*TRIVIAL, *PLANNERS, SIMULATED)
_TRIED_OUT = 4  # plans that "ours-simulated" tries
LONGEST_MOVE = 1.4  # normalised, of the authors' generator
_HALF = ((-0.28, -0.28), (0.0, -0.28), (0.0, 0.28), (-0.28, 0.28))
# Where hands may go: HIRO's arms, or no arm in the half of the field of view at x > 0.
REACHES = {"cell": ReachConfig(), "half": ReachConfig(_HALF, _HALF)}


@dataclass(frozen=True)
class Problem:
    """What a planner is told.

    Attributes:
        present: The cloth as it lies.
        goal: As it shall lie.
        steps: Manipulations that are left.
        recorded: Those that made the goal from where the task began; for the oracles only.
        spacing: Of the cloth's vertices, metres; for the perturbed oracle.
        rng: Of this task.
        try_out: Tells the grid to which manipulations would lead, or raises `SimulationError`;
            for planners that borrow the true dynamics only.
    """

    present: VoxelGrid
    goal: VoxelGrid
    steps: int
    recorded: tuple[Manipulation, ...]
    spacing: float
    rng: np.random.Generator
    try_out: Callable[[Sequence[Manipulation]], VoxelGrid]


@dataclass(frozen=True)
class Proposal:
    """What a planner answers.

    Attributes:
        manipulations: In order; none: leave the cloth as it is.
        planning_ms: Time that it took.
        failure: Why there is no plan; empty if there is one.
        figures: What the planner tells of the plan, if it tells anything.
    """

    manipulations: tuple[Manipulation, ...]
    planning_ms: float = 0.0
    failure: str = ""
    figures: PlanFigures | None = None


class Rival(ABC):
    """A planner under comparison."""

    @abstractmethod
    def propose(self, problem: Problem) -> Proposal:
        """Plan the manipulations that are left."""


class Idle(Rival):
    """Does nothing; also stands for an empty grid, which is what is scored then."""

    def propose(self, problem: Problem) -> Proposal:
        """Leave the cloth as it is."""
        return Proposal(())


class RandomHands(Rival):
    """Random manipulations by the rule of the authors' generator, on what is seen."""

    def propose(self, problem: Problem) -> Proposal:
        """Draw all steps on the present silhouette."""
        return Proposal(tuple(self._draw(problem) for _ in range(problem.steps)))

    @staticmethod
    def _draw(problem: Problem) -> Manipulation:
        fov, rng = problem.present.field_of_view, problem.rng
        columns = np.argwhere(problem.present.silhouette)
        chosen = columns[rng.integers(len(columns), size=2)] + rng.random((2, 2))
        points = fov.table_from_normalised(2.0 * chosen / np.array(fov.size[:2]) - 1.0)
        if rng.random() < 0.5:
            points[rng.integers(2)] = np.nan
        length = fov.table_from_normalised(rng.uniform(0.0, LONGEST_MOVE))
        angle = rng.uniform(0.0, 2.0 * np.pi)
        return Manipulation(points, length * np.array([np.cos(angle), np.sin(angle)]))


class Oracle(Rival):
    """Performs the recorded manipulations again, grasping `offset` vertices beside."""

    def __init__(self, offset: float = 0.0) -> None:
        """Say how far beside the recorded grasps to grasp, in vertex spacings."""
        self._offset = offset

    def propose(self, problem: Problem) -> Proposal:
        """Give the recorded manipulations that are left."""
        return Proposal(tuple(self._beside(m, problem) for m in problem.recorded))

    def _beside(self, recorded: Manipulation, problem: Problem) -> Manipulation:
        angle = problem.rng.uniform(0.0, 2.0 * np.pi)
        way = self._offset * problem.spacing * np.array([np.cos(angle), np.sin(angle)])
        return Manipulation(recorded.grasp_points_in_table + way, recorded.displacement_in_table)


class NetPlanner(Rival):
    """The EMD net's search."""

    def __init__(
        self,
        net: StatePredictor,
        config: PlannerConfig,
        reach: ReachConfig | None,
        tried_out: int = 1,
    ) -> None:
        """Search with a net.

        Args:
            net: Trained.
            config: Of the search.
            reach: Where points must be; None: anywhere.
            tried_out: Of so many plans take the one that turns out best in the simulation; 1:
                the one that the net thinks best.
        """
        self._net, self._config, self._reach = net, config, reach
        self._tried_out = tried_out

    def propose(self, problem: Problem) -> Proposal:
        """Plan all steps that are left."""
        started = time.perf_counter()
        try:
            plans = alternatives(
                self._net,
                problem.present,
                problem.goal,
                problem.steps,
                self._tried_out,
                self._config,
                self._reach,
                int(problem.rng.integers(2**31)),
            )
        except NoPlanError as err:
            return Proposal((), 1e3 * (time.perf_counter() - started), str(err))
        found = plans[0] if len(plans) == 1 else min(plans, key=partial(_outcome, problem))
        elapsed = 1e3 * (time.perf_counter() - started)
        return Proposal(tuple(found.manipulations), elapsed, figures=PlanFigures.of(found))


def _outcome(problem: Problem, found: FoldPlan) -> float:
    try:
        return voxel_mse(problem.try_out(found.manipulations), problem.goal)
    except SimulationError:
        return math.inf


def make_rivals(
    names: tuple[str, ...], weights: Path | None, reach: ReachConfig | None
) -> dict[str, Rival]:
    """Make planners by name.

    Args:
        names: Of `RIVALS`.
        weights: Of the net; the shipped ones if None.
        reach: Where hands may go, for the planners that heed it; None: anywhere.

    Raises:
        InvalidInputError: If a name is unknown.
        ModelError: If the weights cannot be used.
    """
    unknown = sorted(set(names) - set(RIVALS))
    if unknown:
        raise InvalidInputError(f"planners must be of {', '.join(RIVALS)}, got {unknown}")
    net = None
    if set(names) - set(TRIVIAL):
        keep_freed_memory()
        net = load_net(weights)
    rivals: dict[str, Rival] = {}
    for name in names:
        if name not in TRIVIAL:
            assert net is not None
            simulated = name == SIMULATED
            config = PLANNERS["ours" if simulated else name]
            rivals[name] = NetPlanner(net, config, reach, _TRIED_OUT if simulated else 1)
        elif name == "random":
            rivals[name] = RandomHands()
        elif name in ("oracle", "oracle_perturbed"):
            rivals[name] = Oracle(1.0 if name == "oracle_perturbed" else 0.0)
        else:
            rivals[name] = Idle()
    return rivals


def within_reach(manipulation: Manipulation, regions: list[FloatArray]) -> bool:
    """Whether some arm reaches each grasp and its release, no arm both hands; see `ReachConfig`.

    Args:
        manipulation: In the table frame.
        regions: Convex corners of each arm's region, (N, 2), metres.
    """
    used = np.flatnonzero(manipulation.used)
    points = np.stack(
        [manipulation.grasp_points_in_table[used], manipulation.release_points_in_table[used]]
    )
    reached = [
        [_inside(points[:, hand], region) for region in regions] for hand in range(len(used))
    ]
    if len(used) == 1:
        return any(reached[0])
    return (reached[0][0] and reached[1][1]) or (reached[0][1] and reached[1][0])


def _inside(points: FloatArray, corners: FloatArray) -> bool:
    edges = np.roll(corners, -1, axis=0) - corners
    relative = points[:, None] - corners
    turns = edges[:, 0] * relative[..., 1] - edges[:, 1] * relative[..., 0]
    return bool(((turns >= 0).all(axis=1) | (turns <= 0).all(axis=1)).all())
