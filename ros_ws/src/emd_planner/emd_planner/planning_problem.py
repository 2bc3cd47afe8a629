"""One planning problem: the parts that searches for different numbers of steps share."""

from __future__ import annotations

import itertools
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
from emd_planner.interruption import TimeIsUp, Watch, ask_between_layers
from emd_planner.into_reach import into_reach
from emd_planner.losses import state_loss
from emd_planner.outline_folds import outline_folds
from emd_planner.plan_cost import plan_cost
from emd_planner.planner import SearchProgress, SearchResult, search
from emd_planner.planning_net import planning_copy
from emd_planner.silhouette import columns_of, onto_silhouette, silhouettes
from emd_planner.starts import guessed_sequences, random_values, without_doubtful_hand
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
        self._config = config
        self._net, self._fast_net = (planning_copy(net, fast) for fast in (False, config.bfloat16))
        self._watch: Callable[[], None] = lambda: None
        for planning_net in (self._net, self._fast_net):
            ask_between_layers(planning_net, lambda: self._watch())
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
            self._code = self._net.encode(self._initial[None])
            reconstruction = state_loss(self._net.decode(self._code), self._initial.float())
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

    def search(self, steps: int, seed: int, watch: Watch) -> SearchResult:
        """Search for sequences of so many manipulations.

        Args:
            steps: Manipulations in each.
            seed: Of the starts.
            watch: Asked between the layers of the net.

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

    def candidates(
        self, found: SearchResult, watch: Callable[[], None] = lambda: None
    ) -> Iterator[Candidate]:
        """Give the sequences that grasp cloth in every step.

        Adjusting them can change their costs, so the `judged` cheapest of the search are adjusted
        before any is given, and come in the order of the costs they have then; the others follow
        as the search ordered them.

        Args:
            found: What a search gave.
            watch: Asked between the layers of the net, as in `search`; it should know no
                deadline, as what was found by then is adjusted after it.

        Raises:
            CancelledError: If the watch says so.
        """
        self._watch = watch
        rows = [
            values
            for values, cost in zip(found.values, found.costs, strict=True)
            if cost.isfinite()
        ]
        judged = self._config.judged
        if rows:
            yield from sorted(self._best_ways(rows[:judged]), key=lambda candidate: candidate.cost)
        for values in rows[judged:]:
            yield from self._best_ways([values])

    def _best_ways(self, sequences: Sequence[Tensor]) -> list[Candidate]:
        """Adjust sequences; where a first hand is just beside the cloth, without it, too.

        Of these ways the cheapest is given for each sequence, none if none is left.
        """
        ways = [[values] for values in sequences]
        if self._config.grasp_on_cloth:
            tolerance = self._config.grasp_tolerance_voxels
            for values, options in zip(sequences, ways, strict=True):
                options += without_doubtful_hand(values, silhouettes(self._graspable), tolerance)
        found = iter(self._candidates(torch.stack(list(itertools.chain(*ways)))))
        best = []
        for options in ways:
            left = [way for way in islice(found, len(options)) if way is not None]
            best += [min(left, key=lambda candidate: candidate.cost)] if left else []
        return best

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
        guesses = round(config.guessed_share * count)
        guessed = None
        if guesses > 0:
            # Of a random start the first step is random; how it goes on is guessed as well.
            first = [self._random(count - guesses, 1, generator)[:, 0]]
            if config.outline_folds:
                first.append(self._outline_folds())
            guessed = guessed_sequences(
                self._fast_net,
                self._initial,
                self._goal,
                steps,
                guesses,
                generator,
                self._limits,
                config.threshold,
                torch.cat(first),
            )
        if guessed is not None:
            values, states = guessed.values, guessed.states
        else:
            values = self._random(count, steps, generator)
            if count == config.restarts:
                return values, None
            states = self._predict(values)
        costs = self._cost.total(states, values)
        best = costs.nan_to_num(torch.inf).argsort(stable=True)[: config.restarts]
        return values[best], costs[best]

    def _random(self, count: int, steps: int, generator: torch.Generator) -> Tensor:
        """Draw sequences (count, steps, 6) as the config says."""
        return random_values(
            count,
            steps,
            silhouettes(self._graspable) if self._config.start_on_cloth else None,
            generator,
            self._device,
            self._config.max_displacement,
            self._config.single_handed_share,
        )

    def _outline_folds(self) -> Tensor:
        """Folds along the cloth's outline, within reach if hands must keep there, (F, 6)."""
        silhouette = silhouettes(self._graspable)
        folds = outline_folds(silhouette).to(self._device)
        reach = self._cost.reach
        if not self._config.keep_in_reach or reach is None or not len(folds):
            return folds
        hands = folds[:, :4].unflatten(1, (2, 2)).isfinite().all(2)
        moved = folds.nan_to_num()
        for row in (reach(moved, hands) > 0.0).nonzero().flatten().tolist():
            moved[row] = into_reach(moved[row], hands[row], reach, silhouette)
        return torch.where(folds.isnan(), torch.nan, moved)

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
    def _candidates(self, values: Tensor) -> list[Candidate | None]:
        """Adjust sequences (K, n, 6) and predict them with the net itself.

        None for one of which a step grasps no cloth, the first one grasps where something hides
        the cloth, or one leaves the reach in which it must be kept.
        """
        values = values.clone()
        states, used = self._foreseen(values)
        rows = torch.arange(len(values), device=self._device)
        for _ in range(_ADJUSTMENTS):
            # A step that is adjusted may change which hands grasp in those that follow.
            adjusted = self._adjusted(values[rows], used[rows], states[rows])
            changed = (adjusted != values[rows]).flatten(1).any(1)
            values[rows] = adjusted
            rows = rows[changed]
            if not len(rows):
                break
            states[rows], used[rows] = self._foreseen(values[rows])
        costs = self._cost.total(states, values)
        excess = torch.zeros_like(costs)
        if self._cost.reach is not None:
            excess = self._cost.reach(values, used).sum(1)
        return [
            self._candidate(*row) for row in zip(values, used, states, costs, excess, strict=True)
        ]

    def _candidate(
        self, values: Tensor, used: Tensor, states: Tensor, cost: Tensor, excess: Tensor
    ) -> Candidate | None:
        if not used.any(1).all() or self._is_hidden(values[0, :4].view(2, 2)[used[0]]):
            return None
        if self._config.keep_in_reach and excess > 0.0:
            return None
        metres = float(excess) * self._field_of_view.half_extent
        return Candidate(values, used, states, float(cost), metres)

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

    def _foreseen(self, values: Tensor) -> tuple[Tensor, Tensor]:
        """Give the states after each manipulation of sequences (K, n, 6), and which hands grasp.

        Returns:
            Shape (K, n, X, Y, Z), and boolean (K, n, 2).
        """
        code = self._code.expand(len(values), *self._code.shape[1:])
        codes = torch.stack(self._net.roll_out(code, values), 1)
        states = self._net.decode(codes.flatten(0, 1)).unflatten(0, codes.shape[:2])
        tolerance = self._config.grasp_tolerance_voxels
        return states, grasps_cloth(values, self._before(states), tolerance)

    def _before(self, states: Tensor) -> Tensor:
        """Give the states before each manipulation, boolean, of those after, (K, n, X, Y, Z)."""
        return states_before(self._graspable, states, self._config.threshold)

    def _adjusted(self, values: Tensor, used: Tensor, states: Tensor) -> Tensor:
        """Move grasps onto the cloth that is seen, and all into reach, as the config says.

        Args:
            values: Shape (K, n, 6).
            used: Boolean, shape (K, n, 2).
            states: After each step, shape (K, n, X, Y, Z).
        """
        values = values.clone()
        if self._config.grasp_on_cloth:
            points, hands = values[:, 0, :4].unflatten(1, (2, 2)), used[:, 0]
            points[hands] = onto_silhouette(points[hands], silhouettes(self._graspable))
        reach = self._cost.reach
        if self._config.keep_in_reach and reach is not None:
            cloth = silhouettes(self._before(states))
            for row, step in (reach(values, used) > 0.0).nonzero().tolist():
                place = row, step
                values[place] = into_reach(values[place], used[place], reach, cloth[place])
        return values
