"""From an initial and a goal state to manipulations: the planner as a whole (paper, III-C)."""

from __future__ import annotations

import dataclasses
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from emd_core.errors import InvalidInputError, NoPlanError
from emd_core.manipulation import Manipulation
from emd_core.voxel_grid import VoxelGrid
from emd_planner.config import PlannerConfig, Polygon, ReachConfig
from emd_planner.cost import expected_goal_term, grasps_cloth, states_before
from emd_planner.losses import state_loss
from emd_planner.plan_cost import plan_cost
from emd_planner.planner import SearchProgress, SearchResult, search
from emd_planner.planning_net import in_bfloat16
from emd_planner.silhouette import onto_silhouette, silhouettes
from emd_planner.starts import guessed_values, random_values
from emd_planner.state_predictor import StatePredictor


@dataclass(frozen=True)
class PlanningProgress:
    """A search for a plan of `steps` manipulations after an iteration.

    Attributes:
        steps: Manipulations in the plans that are tried now.
        search: The search's own progress; its values are normalised.
    """

    steps: int
    search: SearchProgress


@dataclass(frozen=True)
class FoldPlan:
    """Manipulations and what the net expects of them.

    Attributes:
        manipulations: In order; table frame, metres, NaN points for unused hands.
        predicted_probabilities: After each manipulation, shape (n, X, Y, Z), float32, 0..1.
        predicted_grids: The same, thresholded.
        predicted_loss: loss_s of the last prediction with respect to the goal.
        expected_error: Voxel MSE to be expected of the executed plan's outcome with respect to the
            goal, if the net's probabilities are right: predicted_loss and what the net is unsure
            of. A plan is worth executing if this is less than what the present state scores.
        initial_loss: loss_s of the initial state: what doing nothing scores.
        reconstruction_loss: loss_s of D(E(initial)) to the initial state: how well the net knows
            states like this one. A gain smaller than it is within the net's own error.
        reach_excess: Metres by which grasp and release points lie outside the arms' reach,
            summed; 0 without reach limits.
        planning_ms: Time taken, milliseconds.
        iterations: Iterations of all searches.
    """

    manipulations: list[Manipulation]
    predicted_probabilities: NDArray[np.float32]
    predicted_grids: list[VoxelGrid]
    predicted_loss: float
    expected_error: float
    initial_loss: float
    reconstruction_loss: float
    reach_excess: float
    planning_ms: float
    iterations: int


@dataclass(frozen=True)
class _Candidate:
    values: Tensor
    used: Tensor
    states: Tensor
    loss: float
    cost: float
    reach_excess: float


def plan(
    net: StatePredictor,
    initial: VoxelGrid,
    goal: VoxelGrid,
    steps: int,
    config: PlannerConfig | None = None,
    reach: ReachConfig | None = None,
    seed: int = 0,
    on_iteration: Callable[[PlanningProgress], None] | None = None,
    should_stop: Callable[[], bool] | None = None,
    keep_out: Sequence[Polygon] = (),
) -> FoldPlan:
    """Find manipulations that lead from the initial to the goal state.

    Args:
        net: Trained; see `load_net`.
        initial: The cloth as it lies.
        goal: The cloth as it shall lie.
        steps: Manipulations in the plan; 0: as few as come near the best of 1 to
            `config.max_steps`.
        config: Settings of the search.
        reach: Where the arms can grasp and release; None: anywhere.
        seed: Of the random starts; the same call with the same seed gives the same plan (unless
            the time budget ends it).
        on_iteration: Told of the progress after every iteration.
        should_stop: Asked before every iteration.
        keep_out: Corners (x, y) of convex regions, metres, table frame, in which no hand shall
            grasp, release or pass.

    Raises:
        InvalidInputError: If grids, net and steps do not fit each other.
        CancelledError: If `should_stop` says so.
        NoPlanError: If no restart ended with a grasp on the cloth in every step.
    """
    started = time.monotonic()
    config = config or PlannerConfig()
    _check(net, initial, goal, steps)
    planner = _Planner(net, initial, goal, config, reach, keep_out, on_iteration, should_stop)
    tried = [steps] if steps > 0 else list(range(1, config.max_steps + 1))
    candidates = []
    for count in tried:
        candidate = planner.best(count, seed, config.time_budget / len(tried))
        if candidate is not None:
            candidates.append(candidate)
    if not candidates:
        raise NoPlanError(
            f"none of {config.restarts} restarts for {tried} steps ended with a grasp on the "
            "cloth in every step; is the goal what the initial state shows already? Otherwise "
            "try more restarts, fewer steps or another seed"
        )
    chosen = _fewest_steps(candidates, config.step_margin)
    elapsed = 1000.0 * (time.monotonic() - started)
    return planner.fold_plan(chosen, elapsed)


class _Planner:
    """One planning problem: the parts that searches for different numbers of steps share."""

    def __init__(
        self,
        net: StatePredictor,
        initial: VoxelGrid,
        goal: VoxelGrid,
        config: PlannerConfig,
        reach: ReachConfig | None,
        keep_out: Sequence[Polygon],
        on_iteration: Callable[[PlanningProgress], None] | None,
        should_stop: Callable[[], bool] | None,
    ) -> None:
        self.net, self.config = net, config
        self.fast_net = in_bfloat16(net) if config.bfloat16 else net
        self.field_of_view = initial.field_of_view
        self.on_iteration, self.should_stop = on_iteration, should_stop
        self.device = next(net.parameters()).device
        self.initial = torch.from_numpy(initial.occupancy).to(self.device)
        self.goal = torch.from_numpy(goal.occupancy).to(self.device)
        self.iterations = 0
        limits = [1.0] * 4 + [config.max_displacement] * 2
        self.limits = torch.tensor(limits, device=self.device)
        with torch.no_grad():
            self.code = net.encode(self.initial[None])
            reconstruction = state_loss(net.decode(self.code), self.initial.float())
        self.reconstruction_loss = float(reconstruction)
        self.cost = plan_cost(config, self.initial, self.goal, self.field_of_view, reach, keep_out)

    def best(self, steps: int, seed: int, time_budget: float) -> _Candidate | None:
        """Search, and give the best restart that grasps cloth in every step."""
        config = self.config
        generator = torch.Generator().manual_seed(seed)
        starts = self._most_promising(self._starts(steps, generator))
        told = None
        if self.on_iteration is not None:
            callback = self.on_iteration

            def told(progress: SearchProgress) -> None:
                callback(PlanningProgress(steps, progress))

        found = search(
            self._predict,
            self.cost.total,
            starts,
            _with_budget(config, time_budget),
            told,
            self.should_stop,
            self.limits,
        )
        self.iterations += found.iterations
        return self._first_that_grasps(found)

    def _starts(self, steps: int, generator: torch.Generator) -> Tensor:
        """Draw `candidates` starts, or `restarts` if these are more."""
        config = self.config
        count = max(config.candidates, config.restarts)
        guessed = None
        if guesses := round(config.guessed_share * count):
            guessed = guessed_values(
                self.fast_net,
                self.initial,
                self.goal,
                steps,
                guesses,
                generator,
                config.threshold,
            )
        random = random_values(
            count - (0 if guessed is None else guesses),
            steps,
            silhouettes(self.initial) if config.start_on_cloth else None,
            generator,
            self.device,
            config.max_displacement,
            config.single_handed_share,
        )
        return random if guessed is None else torch.cat([self._limited(guessed), random])

    def _limited(self, values: Tensor) -> Tensor:
        return values.clamp(-self.limits, self.limits)

    @torch.no_grad()
    def _most_promising(self, starts: Tensor) -> Tensor:
        """Keep the `restarts` starts that are predicted to cost least."""
        if len(starts) == self.config.restarts:
            return starts
        costs = self.cost.total(self._predict(starts), starts).nan_to_num(torch.inf)
        return starts[costs.argsort(stable=True)[: self.config.restarts]]

    def fold_plan(self, candidate: _Candidate, elapsed_ms: float) -> FoldPlan:
        """Turn a candidate into the planner's answer."""
        states = candidate.states.cpu().numpy()
        values = candidate.values.double().cpu().numpy()
        used = candidate.used.cpu().tolist()
        return FoldPlan(
            [
                Manipulation.from_network(values[i], (used[i][0], used[i][1]), self.field_of_view)
                for i in range(len(values))
            ],
            states,
            [VoxelGrid(state >= self.config.threshold, self.field_of_view) for state in states],
            candidate.loss,
            float(expected_goal_term(self.goal)(candidate.states[None], candidate.values[None])),
            float((self.initial != self.goal).float().mean()),
            self.reconstruction_loss,
            candidate.reach_excess,
            elapsed_ms,
            self.iterations,
        )

    def _predict(self, values: Tensor) -> Tensor:
        """Predict states (A, n, X, Y, Z), those before the last without gradients."""
        codes = self.fast_net.roll_out(self.code.expand(len(values), *self.code.shape[1:]), values)
        last = self.fast_net.decode(codes[-1])[:, None]
        if len(codes) == 1 or not self.cost.needs_every_state:
            return last
        with torch.no_grad():
            before = self.fast_net.decode(torch.cat(codes[:-1]))
        return torch.cat([before.unflatten(0, (len(codes) - 1, -1)).transpose(0, 1), last], 1)

    @torch.no_grad()
    def _first_that_grasps(self, found: SearchResult) -> _Candidate | None:
        codes = self.net.roll_out(
            self.code.expand(len(found.values), *self.code.shape[1:]), found.values
        )
        states = self.net.decode(torch.stack(codes, 1).flatten(0, 1))
        states = states.unflatten(0, found.values.shape[:2])
        before = states_before(self.initial, states, self.config.threshold)
        used = grasps_cloth(found.values, before, self.config.grasp_tolerance_voxels)
        grasping = used.any(2).all(1) & found.costs.isfinite()
        if not grasping.any():
            return None
        row = int(grasping.nonzero()[0])
        if self.config.grasp_on_cloth:
            points = found.values[row, 0, :4].view(2, 2)
            hands = used[row, 0]
            points[hands] = onto_silhouette(points[hands], silhouettes(self.initial))
        excess = 0.0
        if self.cost.reach is not None:
            rows = slice(row, row + 1)
            excess = float(self.cost.reach(states[rows], found.values[rows]))
        return _Candidate(
            found.values[row],
            used[row],
            states[row],
            float(state_loss(states[row, -1:], self.goal.float())),
            float(found.costs[row]),
            excess * self.field_of_view.half_extent,
        )


def _fewest_steps(candidates: list[_Candidate], margin: float) -> _Candidate:
    """Take the shortest plan whose cost is within a margin of the best one's."""
    limit = (1.0 + margin) * min(candidate.cost for candidate in candidates)
    return next(candidate for candidate in candidates if candidate.cost <= limit)


def _with_budget(config: PlannerConfig, seconds: float) -> PlannerConfig:
    return dataclasses.replace(config, time_budget=seconds)


def _check(net: StatePredictor, initial: VoxelGrid, goal: VoxelGrid, steps: int) -> None:
    if steps < 0:
        raise InvalidInputError(f"steps must be 1 or more, or 0 to choose, got {steps}")
    if initial.field_of_view != goal.field_of_view:
        raise InvalidInputError(
            f"initial and goal state must cover one field of view, got {initial.field_of_view} "
            f"and {goal.field_of_view}; voxelise both alike"
        )
    if tuple(initial.occupancy.shape) != net.config.grid_size:
        raise InvalidInputError(
            f"the net takes grids of {net.config.grid_size}, got {initial.occupancy.shape}; "
            "voxelise with the net's field of view"
        )
    for name, grid in (("initial", initial), ("goal", goal)):
        if not grid.occupancy.any():
            raise InvalidInputError(f"the {name} state holds no cloth; look again")
