"""What the page is told."""

import base64
import json

import numpy as np
from fake_cell import HALF, flat_grid

from emd_arm_executor.hiro.description import (
    OBSERVE,
    URDF_PATH,
    CellGeometry,
    transform_camera_to_table,
)
from emd_console.cell_state import CellState, thinned
from emd_console.health import report_from_status
from emd_console.robot_view import RobotView
from emd_console.sections import heights, sections
from emd_core.pinhole_camera import PinholeCamera

HEAD = OBSERVE.by_joint()
POSE = transform_camera_to_table(HEAD["HEAD_JOINT0"], HEAD["HEAD_JOINT1"])


class Clock:
    """Seconds that pass when told to."""

    now = 100.0

    def __call__(self) -> float:
        """Give the time."""
        return self.now


def test_a_console_that_heard_nothing_still_has_all_to_show(desk) -> None:
    """Every section is JSON, with nodes that are missed."""
    shown = json.loads(json.dumps(sections(CellState(), desk), allow_nan=False))
    assert set(shown) == {"status", "nodes", "overlay", "grids", "search", "folds", "robot"}
    assert {node["level"] for node in shown["nodes"]} == {"silent"}


def test_heights_are_counts_of_columns() -> None:
    """As many as there are voxels."""
    sent = heights(flat_grid())
    counts = np.frombuffer(base64.b64decode(sent["data"]), dtype=np.uint8)
    assert sent["size"] == [32, 32, 16] and counts.sum() == flat_grid().occupancy.sum()


def test_a_dead_node_moves_and_plans_no_longer(desk) -> None:
    """Its last word does not count once it has fallen silent."""
    clock = Clock()
    state = CellState(clock)
    for node in ("planner", "arm_executor"):
        state.report(report_from_status(f"{node}: x", 0, "", node, clock.now))
    state.update(moving=True, planning=True)
    state.motion_feedback("carry", 0.4)
    shown = sections(state, desk)["status"]
    assert shown["moving"] and shown["phase"] == "carry" and shown["planning"]
    clock.now += 60
    shown = sections(state, desk)["status"]
    assert not shown["moving"] and not shown["planning"] and shown["phase"] == ""


def test_the_search_is_drawn_while_it_runs(desk) -> None:
    """The best manipulations so far, in pixels; the curve of one goal at a time."""
    state = CellState(Clock())
    state.update(camera=PinholeCamera(), transform_camera_to_table=POSE, planning=True)
    state.report(report_from_status("planner: x", 0, "", "planner", 100.0))
    state.search_feedback(b"a", 1, 0.5, (HALF,))
    state.search_feedback(b"b", 1, 0.4, (HALF,))
    state.search_feedback(b"b", 2, 0.3, (HALF,))
    shown = sections(state, desk)
    assert shown["search"]["losses"] == [[1, 0.4], [2, 0.3]]
    ((left, right),) = shown["overlay"]["arrows"]
    assert left[0][1] < left[1][1] and left[0][0] < right[0][0]


def test_a_long_curve_is_thinned_with_its_ends_kept() -> None:
    """Memory stays bounded."""
    losses: tuple[tuple[int, float], ...] = ()
    for iteration in range(5000):
        losses = thinned((*losses, (iteration, 1.0)), 100)
        assert len(losses) <= 100 and losses[-1][0] == iteration
    assert losses[0][0] == 0


def test_the_table_is_where_the_cell_has_it(desk) -> None:
    """Found through the camera, which the description and the table frame both know."""
    state = CellState()
    state.update(
        robot=RobotView(URDF_PATH.read_text()),
        joints={**HEAD, "CHEST_JOINT0": 0.0},
        transform_camera_to_table=POSE,
    )
    table = np.array(sections(state, desk)["robot"]["table"]).reshape(4, 4)
    assert np.allclose(table, CellGeometry().transform_table_to_waist, atol=2e-3)
