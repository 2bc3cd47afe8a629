"""One planning problem: the parts that searches for different numbers of steps share."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import islice

import torch
from torch import Tensor

from emd_core.errors import InvalidInputError
from emd_core.manipulation import Manipulation
from emd_core.reach_map import ReachMap
from emd_core.voxel_grid import VoxelGrid
from emd_planner.config import PlannerConfig, Polygon, ReachConfig
from emd_planner.cost import expected_goal_term, goal_term, grasps_cloth, states_before
from emd_planner.fold_plan import FoldPlan, PlanningProgress
from emd_planner.interruption import TimeIsUp, ask_between_layers
from emd_planner.into_reach import into_reach
from emd_planner.losses import state_loss
from emd_planner.outline_folds import outline_folds
from emd_planner.plan_cost import plan_cost
from emd_planner.planner import SearchProgress, SearchResult, search
from emd_planner.planning_net import planning_copy
from emd_planner.silhouette import columns_of, onto_silhouette, silhouettes
from emd_planner.starts import (
    guessed_sequences,
    random_values,
    with_one_hand,
    without_doubtful_hand,
)
from emd_planner.state_predictor import StatePredictor

_ADJUSTMENTS = 3  # of a sequence, each of which may call for another one


@dataclass(frozen=True)
class Candidate:
    """A sequence that grasps cloth in every step, and what the net predicts of it.

    Attributes:
        values: Manipulations, normalised, shape (n, 6).
        used: Which hands grasp, boolean, shape (n, 2).
        states: After each manipulation, shape (n, X, Y, Z).
        cost: What it costs as the net itself predicts it.
        reach_excess: Metres by which points lie outside the arms' reach, summed.
    """

    values: Tensor
    used: Tensor
    states: Tensor
    cost: float
    reach_excess: float


class PlanningProblem:
    """From one initial state to one goal.

    Attributes:
        iterations: Done so far, of all searches.
    """

    def __init__(
        self,
        net: StatePredictor,
        initial: VoxelGrid,
        goal: VoxelGrid,
        config: PlannerConfig,
        reach: ReachConfig | ReachMap | None = None,
        keep_out: Sequence[Polygon] = (),
        on_iteration: Callable[[PlanningProgress], None] | None = None,
    ) -> None:
        """Prepare; the arguments are those of `emd_planner.plan.plan`.

        Raises:
            InvalidInputError: If something hides all of the cloth, or a region is not convex.
        """
        self._net, self._config = net, config
        self._fast_net = planning_copy(net, config.bfloat16)
        ask_between_layers(self._fast_net, lambda: self._watch())
        self._watch: Callable[[], None] = lambda: None
        self._on_iteration = on_iteration
        self._field_of_view = initial.field_of_view
        self._device = next(net.parameters()).device
        self._initial = torch.from_numpy(initial.occupancy).to(self._device)
        self._goal = torch.from_numpy(goal.occupancy).to(self._device)
        self._goal_known = self._known_columns(goal)
        # Where something hides the cloth no hand grasps, whatever was seen of it.
        self._known = self._known_columns(initial)
        self._graspable = self._initial
        if self._known is not None:
            self._graspable = self._initial & self._known[..., None]
        if not self._graspable.any():
            raise InvalidInputError(
                "cloth that a hand can grasp is wanted, but all that is seen of it lies where "
                "something hides it; take that away and look again"
            )
        limits = [1.0] * 4 + [config.max_displacement] * 2
        self._limits = torch.tensor(limits, device=self._device)
        with torch.no_grad():
            self._code = net.encode(self._initial[None])
            reconstruction = state_loss(net.decode(self._code), self._initial.float())
        self._reconstruction_loss = float(reconstruction)
        self._cost = plan_cost(
            config,
            self._graspable,
            self._goal,
            self._field_of_view,
            reach,
            keep_out,
            self._goal_known,
        )
        self.iterations = 0

    def search(self, steps: int, seed: int, watch: Callable[[], None]) -> SearchResult:
        """Search for sequences of so many manipulations.

        Args:
            steps: Manipulations in each.
            seed: Of the starts.
            watch: Asked between the layers of the net; see `emd_planner.interruption.Watch`.

        Returns:
            The best of each restart; nothing if time was up before any had been rated.

        Raises:
            CancelledError: If the watch says so.
        """
        self._watch = watch
        generator = torch.Generator().manual_seed(seed)
        try:
            starts, costs = self._starts(steps, generator)
        except TimeIsUp:
            return SearchResult(torch.empty(0, steps, 6), torch.empty(0), 0)
        told = None
        if self._on_iteration is not None:
            callback = self._on_iteration

            def told(progress: SearchProgress) -> None:
                callback(PlanningProgress(steps, progress))

        found = search(
            self._predict,
            self._cost.total,
            starts,
            self._config,
            told,
            watch,
            self._limits,
            costs,
        )
        self.iterations += found.iterations
        return found

    def candidates(self, found: SearchResult) -> Iterator[Candidate]:
        """Give the sequences that grasp cloth in every step.

        Adjusting them can change their costs, so the `judged` cheapest of the search are adjusted
        before any is given, and come in the order of the costs they have then; the others follow
        as the search ordered them.
        """
        rows = (
            values
            for values, cost in zip(found.values, found.costs, strict=True)
            if cost.isfinite()
        )
        adjusted = (self._best_way(values) for values in rows)
        judged = [way for way in islice(adjusted, self._config.judged) if way is not None]
        yield from sorted(judged, key=lambda candidate: candidate.cost)
        yield from (way for way in adjusted if way is not None)

    def _best_way(self, values: Tensor) -> Candidate | None:
        """Adjust a sequence; where one of its first hands is beside the cloth, without it, too."""
        options = [values]
        if self._config.grasp_on_cloth:
            tolerance = self._config.grasp_tolerance_voxels
            options += without_doubtful_hand(values, silhouettes(self._graspable), tolerance)
        ways = [way for option in options if (way := self._candidate(option)) is not None]
        return min(ways, key=lambda candidate: candidate.cost, default=None)

    def fold_plan(self, candidate: Candidate, elapsed_ms: float) -> FoldPlan:
        """Turn a candidate into the planner's answer."""
        states = candidate.states.cpu().numpy()
        outcome = candidate.states[None], candidate.values[None]
        start = self._initial.float()[None, None], candidate.values[None]
        values = candidate.values.double().cpu().numpy()
        used = candidate.used.cpu().tolist()
        return FoldPlan(
            [
                Manipulation.from_network(values[i], (used[i][0], used[i][1]), self._field_of_view)
                for i in range(len(values))
            ],
            states,
            [VoxelGrid(state >= self._config.threshold, self._field_of_view) for state in states],
            float(goal_term(self._goal, self._goal_known)(*outcome)),
            float(expected_goal_term(self._goal, self._goal_known)(*outcome)),
            float(goal_term(self._goal, self._goal_known)(*start)),
            self._reconstruction_loss,
            candidate.reach_excess,
            elapsed_ms,
            self.iterations,
        )

    @torch.no_grad()
    def _starts(self, steps: int, generator: torch.Generator) -> tuple[Tensor, Tensor | None]:
        """Draw `candidates` starts and keep the `restarts` of them that are rated best.

        If `restarts` are more, so many are drawn. Gives their costs too if they were rated.
        """
        config = self._config
        count = max(config.candidates, config.restarts)
        guessed = None
        if guesses := round(config.guessed_share * count):
            guessed = guessed_sequences(
                self._fast_net,
                self._initial,
                self._goal,
                steps,
                guesses,
                generator,
                self._limits,
                config.threshold,
                self._outline_folds() if config.outline_folds else None,
            )
        values = random_values(
            count if guessed is None else count - guesses,
            steps,
            silhouettes(self._graspable) if config.start_on_cloth else None,
            generator,
            self._device,
            config.max_displacement,
            config.single_handed_share,
        )
        known = 0 if guessed is None else len(guessed.values)
        if known + len(values) == config.restarts:
            return (values if guessed is None else torch.cat([guessed.values, values])), None
        costs = self._cost.total(self._predict(values), values)
        if guessed is not None:
            costs = torch.cat([self._cost.total(guessed.states, guessed.values), costs])
            values = torch.cat([guessed.values, values])
        values, costs = _cheapest(values, costs, config.restarts)
        if not config.try_single_handed:
            return values, costs
        silhouette = silhouettes(self._graspable)
        single = torch.cat([with_one_hand(values, hand, silhouette, generator) for hand in (0, 1)])
        costs = torch.cat([costs, self._cost.total(self._predict(single), single)])
        return _cheapest(torch.cat([values, single]), costs, config.restarts)

    def _outline_folds(self) -> Tensor:
        """Folds along the cloth's outline, within reach if hands must keep there, (F, 6)."""
        silhouette = silhouettes(self._graspable)
        folds = outline_folds(silhouette).to(self._device)
        reach = self._cost.reach
        if not self._config.keep_in_reach or reach is None or not len(folds):
            return folds
        hands = folds[:, :4].unflatten(1, (2, 2)).isfinite().all(2)
        moved = [
            into_reach(fold.nan_to_num(), used, reach, silhouette)
            for fold, used in zip(folds, hands, strict=True)
        ]
        return torch.where(folds.isnan(), torch.nan, torch.stack(moved))

    def _predict(self, values: Tensor) -> Tensor:
        """Predict states (A, n, X, Y, Z), those before the last without gradients."""
        code = self._code.expand(len(values), *self._code.shape[1:])
        codes = self._fast_net.roll_out(code, values)
        last = self._fast_net.decode(codes[-1])[:, None]
        if len(codes) == 1 or not self._cost.needs_every_state:
            return last
        with torch.no_grad():
            before = self._fast_net.decode(torch.cat(codes[:-1]))
        return torch.cat([before.unflatten(0, (len(codes) - 1, -1)).transpose(0, 1), last], 1)

    @torch.no_grad()
    def _candidate(self, values: Tensor) -> Candidate | None:
        """Adjust a sequence (n, 6) and predict it with the net itself.

        None if a step of it grasps no cloth, the first one grasps where something hides the cloth,
        or one leaves the reach in which it must be kept.
        """
        for _ in range(_ADJUSTMENTS):
            # A step that is adjusted may change which hands grasp in those that follow.
            states, before, used = self._foreseen(values)
            adjusted = self._adjusted(values, used, silhouettes(before))
            if torch.equal(adjusted, values):
                break
            values = adjusted
        else:
            states, _, used = self._foreseen(values)
        if not used.any(1).all() or self._is_hidden(values[0, :4].view(2, 2)[used[0]]):
            return None
        cost = float(self._cost.total(states[None], values[None]))
        excess = 0.0
        if self._cost.reach is not None:
            excess = float(self._cost.reach(values, used).sum())
            if self._config.keep_in_reach and excess > 0.0:
                return None
        return Candidate(values, used, states, cost, excess * self._field_of_view.half_extent)

    def _known_columns(self, grid: VoxelGrid) -> Tensor | None:
        """Columns of a grid that nothing hides, boolean, shape (X, Y); None if that is all."""
        if grid.unknown is None:
            return None
        return torch.from_numpy(~grid.unknown).to(self._device)

    def _is_hidden(self, points: Tensor) -> bool:
        """Whether one of some points (P, 2) lies in a column that something hides at the start."""
        if self._known is None:
            return False
        columns = columns_of(points, self._known.shape[-1])
        return not bool(self._known[columns[:, 0], columns[:, 1]].all())

    def _foreseen(self, values: Tensor) -> tuple[Tensor, Tensor, Tensor]:
        """Give the states after and before each manipulation, and which hands grasp."""
        states = self._net.decode(torch.cat(self._net.roll_out(self._code, values[None])))
        before = states_before(self._graspable, states[None], self._config.threshold)[0]
        tolerance = self._config.grasp_tolerance_voxels
        return states, before, grasps_cloth(values, before, tolerance)

    def _adjusted(self, values: Tensor, used: Tensor, cloth: Tensor) -> Tensor:
        """Move grasps onto the cloth that is seen, and all into reach, as the config says.

        Args:
            values: Shape (n, 6).
            used: Boolean, shape (n, 2).
            cloth: Silhouettes before each step, boolean, shape (n, X, Y).
        """
        values = values.clone()
        if self._config.grasp_on_cloth:
            points, hands = values[0, :4].view(2, 2), used[0]
            points[hands] = onto_silhouette(points[hands], cloth[0])
        if self._config.keep_in_reach and self._cost.reach is not None:
            for step in range(len(values)):
                values[step] = into_reach(values[step], used[step], self._cost.reach, cloth[step])
        return values


def _cheapest(values: Tensor, costs: Tensor, count: int) -> tuple[Tensor, Tensor]:
    """Give the values and costs of the `count` cheapest."""
    costs = costs.nan_to_num(torch.inf)
    best = costs.argsort(stable=True)[:count]
    return values[best], costs[best]
