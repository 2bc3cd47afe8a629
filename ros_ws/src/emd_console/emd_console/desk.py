"""What the operator does with the cell: look, plan, teach, accept, execute, stop, record."""

from __future__ import annotations

import asyncio
import math
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

from emd_console.cell_port import CellPort, Observation
from emd_console.example import Example
from emd_console.example_store import ExampleStore
from emd_console.goals import FILE, PRESENT, WHAT_IF, Goal, neat_goal
from emd_console.outcomes import Fold, Proposal, plan_figures
from emd_console.projection import TableProjection
from emd_console.teaching import Lesson
from emd_console.what_if import WhatIf
from emd_core.errors import BusyError, CancelledError, CellError, InvalidInputError
from emd_core.manipulation import Manipulation
from emd_core.metrics import voxel_mse
from emd_core.voxel_grid import VoxelGrid


@dataclass
class Desk:
    """The state of the work, shared by all pages; one piece of work at a time.

    Attributes:
        port: The cell.
        store: Where examples are recorded.
        restarts: Random initialisations of the search; 0: the planner's default.
        seed: Of the next search; every further search for a goal takes the next one.
        goal: What is chosen.
        proposal: The plan that waits for the operator's word.
        executing: The plan whose first manipulation is being carried out.
        lesson: What is drawn on the picture.
        seen: The last look.
        folds: What was carried out.
        doing: What is under way, in words; empty while nothing is.
        pausing: Whether to go no further after the present manipulation.
        message: The last outcome, in words.
        failed: Whether that was an error.
        who: Who gave the present command.
        what_if: Tries manipulations on a simulated copy of the cloth.
        clock: Gives seconds.
    """

    port: CellPort
    store: ExampleStore
    restarts: int = 0
    seed: int = 0
    goal: Goal | None = None
    proposal: Proposal | None = None
    executing: Proposal | None = None
    lesson: Lesson = field(default_factory=Lesson)
    seen: Observation | None = None
    folds: list[Fold] = field(default_factory=list)
    doing: str = ""
    pausing: bool = False
    message: str = ""
    failed: bool = False
    who: str = "operator"
    what_if: WhatIf = field(default_factory=WhatIf)
    clock: Callable[[], float] = lambda: asyncio.get_running_loop().time()

    async def work(self, doing: str, task: Callable[[], Any]) -> bool:
        """Do one thing and keep its outcome in `message`; False if it failed.

        Raises:
            BusyError: If something else is under way.
        """
        if self.doing:
            raise BusyError(f"the cell is {self.doing}; wait, or press stop")
        self.doing, self.pausing, self.failed = doing, False, False
        try:
            self.message = await task() or ""
        except CancelledError as err:
            text = str(err)
            self.message = text if text.startswith("stopped") else f"stopped: {text}"
            self.failed = True
        except CellError as err:
            self.message, self.failed = str(err), True
        finally:
            self.doing = ""
        return not self.failed

    def choose_goal(self, name: str) -> None:
        """Take a neat fold, or the last look, as goal.

        Raises:
            InvalidInputError: If there is no such goal or nothing was looked at yet.
        """
        if name == PRESENT:
            if self.seen is None:
                raise InvalidInputError("look at the cloth first, then take what is seen as goal")
            self._take_goal(Goal(PRESENT, "As it lay before", self.seen.grid))
        else:
            self._take_goal(neat_goal(name))

    def take_file(self, grid: VoxelGrid) -> None:
        """Take an uploaded grid as goal."""
        self._take_goal(Goal(FILE, "From a file", grid))

    async def look(self) -> str:
        """Observe the cloth."""
        self.seen = await self.port.capture()
        return f"cloth seen, quality {self.seen.quality:.2f}: {self.seen.reason}"

    async def plan(self, steps: int = 0) -> str:
        """Look, then plan to the chosen goal; `steps` 0: as many as the fold takes by hand."""
        goal = self.goal
        if goal is None:
            raise InvalidInputError("choose a goal first")
        self.proposal = None
        await self.look()
        assert self.seen is not None
        seen = self.seen
        plan = await self.port.plan(
            seen.grid, goal.grid, steps or goal.steps, self.seed, self.restarts
        )
        self.seed += 1
        self.proposal = Proposal(goal, seen, plan, voxel_mse(seen.grid, goal.grid))
        return f"a plan of {len(plan.manipulations)} manipulation(s) is ready; look at it"

    def discard(self) -> None:
        """Drop the plan that waits."""
        self.proposal = None

    async def execute_step(self) -> str:
        """Carry out the plan's first manipulation and look."""
        proposal = self._accepted()
        self.proposal, self.executing = None, proposal
        manipulation = proposal.plan.manipulations[0]
        try:
            fold = await self._carry_out(manipulation, "planned", proposal.seen, proposal)
        finally:
            self.executing = None
        return fold.outcome

    async def execute_all(self) -> str:
        """Carry the plan out, looking and planning anew after every manipulation (paper, V-A)."""
        steps = len(self._accepted().plan.manipulations)
        text = await self.execute_step()
        for remaining in range(steps - 1, 0, -1):
            if self.pausing:
                return f"{text}; paused with {remaining} to go, plan again to go on"
            await self.plan(remaining)
            text = await self.execute_step()
        return text

    async def check_lesson(self, projection: TableProjection | None) -> str:
        """Ask the executor whether the arms can do what was drawn; nothing moves."""
        lesson = self.lesson
        lesson.check, lesson.refusal = None, ""
        if projection is None:
            raise InvalidInputError("the camera's calibration and pose are not known yet; wait")
        manipulation = lesson.manipulation(projection)
        if self.seen is None:
            await self.look()
        try:
            lesson.check = await self.port.check(manipulation)
        except CellError as err:
            lesson.refusal = str(err)
            raise
        arms = " and ".join(lesson.check.arms)
        return f"the {arms} arm can do this in {lesson.check.duration:.0f} s; execute it?"

    async def execute_lesson(self, projection: TableProjection | None) -> str:
        """Look, and carry out what was drawn, after it was checked."""
        if self.lesson.check is None or projection is None:
            raise InvalidInputError("draw a manipulation that the arms can do first")
        manipulation = self.lesson.manipulation(projection)
        await self.look()
        assert self.seen is not None
        fold = await self._carry_out(manipulation, "taught", self.seen, None)
        self.lesson.clear()
        return fold.outcome

    async def try_lesson(self, projection: TableProjection | None) -> str:
        """Look, simulate what was drawn on a copy of the cloth, and take the outcome as goal."""
        if projection is None:
            raise InvalidInputError("the camera's calibration and pose are not known yet; wait")
        check = self.lesson.check
        manipulation = check.executed if check else self.lesson.manipulation(projection)
        await self.look()
        assert self.seen is not None
        if self.pausing:
            raise CancelledError("the stop came before the simulation began")
        grid = await self.what_if.outcome(self.seen, manipulation)
        self._take_goal(Goal(WHAT_IF, "What it would become", grid))
        self.lesson.clear()
        return "this is where the cloth would lie; it is the goal now, plan to reach it"

    async def go_home(self) -> str:
        """Send both arms home."""
        await self.port.go_home()
        return "both arms are home"

    async def reset(self) -> str:
        """Lay a flat cloth in the simulation and look."""
        await self.port.reset()
        self.proposal = None
        self.lesson.clear()
        return await self.look()

    def stop(self) -> None:
        """Cancel every motion and search; at any time."""
        self.pausing = True
        self.port.stop()
        self.what_if.stop()

    @property
    def shown(self) -> Proposal | None:
        """The plan to look at: the one that waits, or that is carried out."""
        return self.proposal or self.executing

    def folds_an_hour(self) -> float:
        """Manipulations an hour since the first one began; NaN before it."""
        if not self.folds:
            return math.nan
        begun = self.folds[0].finished - self.folds[0].seconds
        return 3600.0 * len(self.folds) / max(self.clock() - begun, 1.0)

    def _take_goal(self, goal: Goal) -> None:
        self.goal, self.proposal = goal, None

    def _accepted(self) -> Proposal:
        if self.proposal is None:
            raise InvalidInputError("there is no plan to execute; plan first")
        return self.proposal

    async def _carry_out(
        self, planned: Manipulation, kind: str, before: Observation, proposal: Proposal | None
    ) -> Fold:
        """Execute, look, record."""
        started = self.clock()
        execution = await self.port.execute(planned)
        after = self.seen = await self.port.capture()
        goal = proposal.goal if proposal else None
        scores = [voxel_mse(seen.grid, goal.grid) if goal else None for seen in (before, after)]
        details: dict[str, Any] = {
            "goal": goal.name if goal else None,
            "mse_before": scores[0],
            "mse_after": scores[1],
            "seconds": round(self.clock() - started, 1),
        }
        if proposal is not None:
            details["plan"] = plan_figures(proposal.plan)
        example = Example(
            before,
            after,
            planned,
            execution.executed,
            kind,
            self.who,
            goal.grid if goal else None,
            details,
            execution.motion,
        )
        stored = await asyncio.to_thread(self.store.add, example)
        title = goal.title if goal else ""
        now = self.clock()
        fold = Fold(kind, title, scores[0], scores[1], now - started, now, stored.number)
        self.folds.append(fold)
        return fold
