"""What the operator does with the cell."""

import asyncio
import math
from dataclasses import replace

import numpy as np
import pytest
from fake_cell import HALF, observation

from emd_arm_executor.hiro.description import OBSERVE, transform_camera_to_table
from emd_cloth_sim.config import ClothConfig
from emd_cloth_sim.mesh import flat_positions
from emd_console.goals import PRESENT, WHAT_IF, neat_goal
from emd_console.projection import TableProjection
from emd_core.errors import BusyError, InvalidInputError, OutOfReachError
from emd_core.metrics import voxel_mse
from emd_core.pinhole_camera import PinholeCamera

HEAD = OBSERVE.by_joint()
PROJECTION = TableProjection(
    PinholeCamera(), transform_camera_to_table(HEAD["HEAD_JOINT0"], HEAD["HEAD_JOINT1"])
)


def pixel(x: float, y: float) -> tuple[float, float]:
    """Where a point of the table is in the picture."""
    column, row = PROJECTION.pixels(np.array([[x, y, 0.0]]))[0]
    return float(column), float(row)


def test_a_plan_is_made_from_a_new_look_and_waits(desk, cell) -> None:
    """Nothing moves before it is accepted."""
    desk.choose_goal("half")
    assert asyncio.run(desk.work("planning", desk.plan))
    assert cell.calls == ["capture", "plan 1 0"]
    assert desk.proposal.mse_now > 0.01 and math.isnan(desk.proposal.plan.failure_probability)


def test_an_accepted_plan_is_executed_looked_at_and_recorded(desk, cell, store) -> None:
    """The outcome's distance to the goal is known."""
    desk.choose_goal("half")
    asyncio.run(desk.work("planning", desk.plan))
    assert asyncio.run(desk.work("folding", desk.execute_step))
    assert cell.calls[2:] == ["execute", "capture"]
    (fold,) = desk.folds
    assert fold.mse_after == 0.0 < fold.mse_before
    (example,) = store.all()
    assert example.entry["kind"] == "planned" and example.entry["plan"]["expected_error"] == 0.002
    assert example.entry["plan"]["failure_probability"] is None
    assert desk.proposal is None


def test_all_steps_are_planned_anew_after_each(desk, cell) -> None:
    """As the paper re-plans (V-A)."""
    desk.choose_goal("thirds")
    asyncio.run(desk.work("planning", desk.plan))
    assert asyncio.run(desk.work("folding", desk.execute_all))
    assert [call for call in cell.calls if call != "capture"] == [
        "plan 2 0", "execute", "plan 1 1", "execute",
    ]  # fmt: skip
    assert len(desk.folds) == 2


def test_a_pause_ends_the_steps_after_the_present_one(desk, cell) -> None:
    """The plan's rest is not executed."""
    desk.choose_goal("thirds")
    asyncio.run(desk.work("planning", desk.plan))

    async def run() -> None:
        work = asyncio.create_task(desk.work("folding", desk.execute_all))
        await asyncio.sleep(0)
        desk.pausing = True
        await work

    asyncio.run(run())
    assert cell.calls.count("execute") == 1 and "paused with 1 to go" in desk.message


def test_a_stop_ends_the_work_and_nothing_is_recorded(desk, cell, store) -> None:
    """Half a manipulation is no example."""
    desk.choose_goal("half")
    cell.slow = True

    async def run() -> None:
        await desk.work("planning", desk.plan)
        work = asyncio.create_task(desk.work("folding", desk.execute_step))
        await asyncio.sleep(0.01)
        desk.stop()
        await asyncio.wait_for(work, 1.0)

    asyncio.run(run())
    assert "stop" in cell.calls and desk.failed and "stopped" in desk.message
    assert store.all() == [] and desk.doing == ""


def test_two_things_at_once_are_refused(desk, cell) -> None:
    """The first goes on."""
    desk.choose_goal("half")
    cell.slow = True

    async def run() -> None:
        await desk.work("planning", desk.plan)
        work = asyncio.create_task(desk.work("folding", desk.execute_step))
        await asyncio.sleep(0.01)
        with pytest.raises(BusyError, match="folding"):
            await desk.work("looking", desk.look)
        desk.stop()
        await work

    asyncio.run(run())


def test_a_lesson_is_checked_before_it_may_be_executed(desk, cell, store) -> None:
    """The hands' grasp points and displacement are those drawn."""
    desk.lesson.drag(pixel(-0.2, -0.2), pixel(0.2, -0.2))
    desk.lesson.add_hand(pixel(-0.2, 0.2))
    drawn = desk.lesson.manipulation(PROJECTION)
    assert np.allclose(drawn.grasp_points_in_table, HALF.grasp_points_in_table, atol=1e-9)
    assert np.allclose(drawn.displacement_in_table, HALF.displacement_in_table, atol=1e-9)

    async def early() -> str:
        return await desk.execute_lesson(PROJECTION)

    assert not asyncio.run(desk.work("folding", early)) and "execute" not in cell.calls
    asyncio.run(desk.check_lesson(PROJECTION))
    assert asyncio.run(desk.work("folding", early))
    assert cell.calls == ["capture", "check", "capture", "execute", "capture"]
    assert store.all()[0].entry["kind"] == "taught" and desk.lesson.check is None


def test_a_lesson_out_of_reach_is_refused_with_the_executors_words(desk, cell) -> None:
    """And cannot be executed."""
    desk.seen = observation()
    desk.lesson.drag(pixel(-0.2, -0.2), pixel(0.2, -0.2))
    cell.error = OutOfReachError("too far")
    with pytest.raises(OutOfReachError):
        asyncio.run(desk.check_lesson(PROJECTION))
    assert desk.lesson.refusal == "too far" and desk.lesson.check is None


def test_a_click_is_no_motion(desk) -> None:
    """A drag of millimetres is refused, as is a second hand before the first."""
    with pytest.raises(InvalidInputError, match="drag"):
        desk.lesson.add_hand(pixel(0, 0))
    desk.lesson.drag(pixel(0, 0), pixel(0.005, 0))
    with pytest.raises(InvalidInputError, match="20 mm"):
        desk.lesson.manipulation(PROJECTION)


def test_the_present_state_is_a_goal_once_it_was_seen(desk) -> None:
    """Not before."""
    with pytest.raises(InvalidInputError, match="look"):
        desk.choose_goal(PRESENT)
    asyncio.run(desk.look())
    desk.choose_goal(PRESENT)
    assert desk.goal.grid is desk.seen.grid
    with pytest.raises(InvalidInputError, match="half"):
        desk.choose_goal("../../etc/passwd")


def test_what_would_become_of_a_lesson_is_the_goal(desk, cell) -> None:
    """Nothing moves, and a plan to it can be asked for."""
    desk.lesson.drag(pixel(-0.2, -0.2), pixel(0.2, -0.2))
    desk.lesson.add_hand(pixel(-0.2, 0.2))
    states = flat_positions(ClothConfig().vertices, ClothConfig().side_lengths)
    cell.capture = lambda: as_seen(replace(observation(), cloth_states=states))
    assert asyncio.run(desk.work("simulating", lambda: desk.try_lesson(PROJECTION))), desk.message
    assert desk.goal.name == WHAT_IF and desk.lesson.release is None
    assert voxel_mse(desk.goal.grid, neat_goal("half").grid) < 0.02
    assert "execute" not in cell.calls


async def as_seen(seen):
    """What a look gives."""
    return seen
