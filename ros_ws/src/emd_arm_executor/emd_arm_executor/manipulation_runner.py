"""One manipulation from the plan to the way home, with one more try if a grasp fails."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

from emd_arm_executor.executor import ClothLostError, MotionExecutor, ShouldStop
from emd_arm_executor.lift_check import hem_moved
from emd_arm_executor.motion_plan import MotionPlan, PhaseName
from emd_arm_executor.motion_planner import MotionPlanner
from emd_arm_executor.silhouette import Silhouette
from emd_core.errors import CellError, CollisionError, GraspFailedError
from emd_core.frames import FloatArray
from emd_core.independent_manipulation import HandsManipulation

Look = Callable[[], Silhouette | None]


@dataclass(frozen=True)
class RunCallbacks:
    """Who hears of a run, and who is asked whether it should go on.

    Attributes:
        on_plan: Called with each plan before it is carried out.
        on_progress: Called with the plan, the phase and how far that is, 0..1.
        should_stop: As for `MotionExecutor.run`.
        should_pause: As for `MotionExecutor.run`.
    """

    on_plan: Callable[[MotionPlan], None] = lambda plan: None
    on_progress: Callable[[MotionPlan, PhaseName, float], None] = lambda plan, phase, share: None
    should_stop: ShouldStop = lambda: False
    should_pause: ShouldStop = lambda: False


class ManipulationRunner:
    """Plans and carries out manipulations; after a failed grasp it tries one other hem."""

    def __init__(
        self, planner: MotionPlanner, executor: MotionExecutor, look: Look | None = None
    ) -> None:
        """Keep the planner and the executor, both of one robot.

        Args:
            planner: The planner.
            executor: The executor.
            look: Gives the cloth as the camera sees it now, None if it sees nothing; without it
                only the jaws tell whether a grasp succeeded.
        """
        self.planner = planner
        self.executor = executor
        self._look = look or (lambda: None)

    def run(
        self,
        manipulation: HandsManipulation,
        silhouette: Silhouette,
        callbacks: RunCallbacks | None = None,
    ) -> MotionPlan:
        """Carry out a manipulation and see whether the cloth came along.

        If jaws close on nothing, they open and both arms go home. If that left the cloth as it
        was, or the camera sees it lie as before although the jaws were closed on something, the
        manipulation is planned anew without the hems at which it failed, once.

        Args:
            manipulation: In the table frame.
            silhouette: The cloth as it lies.
            callbacks: Who hears of it and may stop it.

        Returns:
            The plan that was carried out.

        Raises:
            GraspFailedError: If the second grasp fails as well, no other hem can be grasped, one
                of two hands took the cloth along and the other did not, or cloth slipped out on
                the way; the arms are home.
            CellError: As the planner and the executor raise them.
        """
        callbacks = callbacks or RunCallbacks()
        first = self._plan(manipulation, silhouette, ())
        failure = self._carry_out(first, silhouette, callbacks)
        if failure is None:
            return first
        second = self._plan_again(manipulation, silhouette, first, failure)
        failure = self._carry_out(second, silhouette, callbacks)
        if failure is None:
            return second
        raise GraspFailedError(f"{failure}; it was the second try, both arms are home")

    def go_home(self, callbacks: RunCallbacks | None = None) -> None:
        """Open the jaws and bring both arms and the torso to rest.

        Raises:
            CollisionError: If every way touches something.
            CellError: As the executor raises them.
        """
        callbacks = callbacks or RunCallbacks()
        joints = self.executor.robot.joint_positions()
        plan = self.planner.plan_home(joints, open_hands=True)
        self.executor.run(plan, None, callbacks.should_stop, callbacks.should_pause)

    def _plan(
        self, manipulation: HandsManipulation, silhouette: Silhouette, avoid: Sequence[FloatArray]
    ) -> MotionPlan:
        joints = self.executor.robot.joint_positions()
        return self.planner.plan_motion(manipulation, silhouette, joints, avoid)

    def _plan_again(
        self,
        manipulation: HandsManipulation,
        silhouette: Silhouette,
        failed: MotionPlan,
        reason: GraspFailedError,
    ) -> MotionPlan:
        """Plan without the hems of a plan whose grasp failed."""
        avoid = [grasp.hem.point_in_table for grasp in failed.grasps.values()]
        try:
            return self._plan(manipulation, silhouette, avoid)
        except CellError as err:
            raise GraspFailedError(
                f"{reason}; no other hem can be grasped: {err}; both arms are home"
            ) from err

    def _carry_out(
        self, plan: MotionPlan, silhouette: Silhouette, callbacks: RunCallbacks
    ) -> GraspFailedError | None:
        """Carry out a plan; give the failure of a grasp that left the cloth where it was.

        Raises:
            GraspFailedError: If a grasp failed but the cloth has moved, or it was lost on the way,
                the arms are home; or if they cannot go home after a failure.
        """
        callbacks.on_plan(plan)
        failure = None
        try:
            self.executor.run(
                plan,
                lambda phase, share: callbacks.on_progress(plan, phase, share),
                callbacks.should_stop,
                callbacks.should_pause,
            )
        except ClothLostError as err:
            self._leave(err, callbacks)
            raise ClothLostError(f"{err}; both arms are home") from err
        except GraspFailedError as err:
            failure = err
            self._leave(err, callbacks)
        seen = self._look()
        if seen is None:
            return failure
        moved = hem_moved(plan.grasps, silhouette, seen, self.executor.config.sight)
        failure = failure or self._seen_failure(plan, moved)
        if failure is not None and any(moved.values()):
            raise GraspFailedError(
                f"{failure}; the cloth has moved all the same: look at it and plan anew; both "
                "arms are home"
            ) from failure
        return failure

    def _leave(self, failure: GraspFailedError, callbacks: RunCallbacks) -> None:
        """Go home after a failure.

        Raises:
            GraspFailedError: If every way home touches something. A collision would mean that the
                arms have not moved.
        """
        try:
            self.go_home(callbacks)
        except CollisionError as blocked:
            raise GraspFailedError(
                f"{failure}; the arms stand where they were then, as they find no way home: "
                f"{blocked}; make room, then call them home"
            ) from blocked

    def _seen_failure(
        self, plan: MotionPlan, moved: Mapping[str, bool]
    ) -> GraspFailedError | None:
        """Tell whether arms that carried something leave no change behind.

        Short ways may, and such along the hem, as a straight hem looks alike all along it.
        """
        least = self.executor.config.sight.radius
        empty = [
            arm
            for arm, has_moved in moved.items()
            if not has_moved
            and abs(plan.displacements_in_table[arm] @ plan.grasps[arm].hem.outward_normal)
            >= least
        ]
        if not empty:
            return None
        return GraspFailedError(
            f"the {' and '.join(empty)} hand should have taken cloth along, the camera sees its "
            "hem where it was"
        )
