"""Whole motions from manipulations."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from emd_arm_executor.config import GraspConfig, MotionConfig, PathConfig
from emd_arm_executor.motion_plan import MotionPlan, Phase, PhaseName
from emd_arm_executor.motion_planner import MotionPlanner
from emd_arm_executor.robot_model import RobotModel
from emd_arm_executor.silhouette import Silhouette
from emd_core.errors import (
    CollisionError,
    InvalidInputError,
    NoHemError,
    OutOfReachError,
)
from emd_core.frames import FloatArray, inverse_transform
from emd_core.manipulation import Manipulation
from emd_core.voxel_grid import voxelise

Make = Callable[..., Manipulation]
Towel = Callable[..., Silhouette]

NEAT_FOLDS = {
    "half, far over near": ([[-0.2, -0.2], [-0.2, 0.2]], [0.4, 0.0]),
    "half, points swapped": ([[-0.2, 0.2], [-0.2, -0.2]], [0.4, 0.0]),
    "half, near over far": ([[0.2, -0.2], [0.2, 0.2]], [-0.4, 0.0]),
    "third": ([[-0.2, -0.2], [-0.2, 0.2]], [0.25, 0.0]),
    "diagonal from the far left": ([[-0.2, -0.2]], [0.4, 0.4]),
    "diagonal from the far right": ([[-0.2, 0.2]], [0.4, -0.4]),
    "diagonal from the near right": ([[0.2, 0.2]], [-0.4, -0.4]),
    "far corner to the centre": ([[-0.2, -0.2]], [0.2, 0.2]),
    "near corner to the centre": ([[0.2, 0.2]], [-0.2, -0.2]),
    "side over side": ([[0.0, -0.2]], [0.0, 0.4]),
}


def _rest(robot: RobotModel) -> dict[str, float]:
    return dict(robot.description.rest)


def _phase(plan: MotionPlan, name: PhaseName) -> Phase:
    return next(phase for phase in plan.phases if phase.name is name)


def _tool_in_table(robot: RobotModel, arm: str, positions: FloatArray) -> FloatArray:
    return inverse_transform(robot.transform_table_to_base) @ robot.arms[arm].forward(positions)


def _configurations(robot: RobotModel, plan: MotionPlan, width: float) -> FloatArray:
    """Every configuration of a plan's segments, sampled more finely than the planner looks."""
    rows = []
    here = _rest(robot)
    for phase in plan.phases:
        for segment in phase.segments:
            positions = segment.sample(0.02).positions
            widths = dict.fromkeys(plan.grasps, width)
            names = segment.path.joint_names
            rows.append(robot.configurations(here, names, positions, widths))
            here.update(zip(names, positions[-1], strict=True))
    return np.concatenate(rows)


@pytest.mark.parametrize("name", NEAT_FOLDS)
def test_neat_folds_are_plannable_and_free(
    planner: MotionPlanner, robot: RobotModel, towel: Towel, task: Make, name: str
) -> None:
    """The folds of the demonstration can be carried out, and nothing touches anything."""
    plan = planner.plan_motion(task(*NEAT_FOLDS[name]), towel(), _rest(robot))
    assert [phase.name for phase in plan.phases] == list(PhaseName)
    assert set(plan.grasps) <= {"left", "right"}
    for q in _configurations(robot, plan, robot.config.grasp.closed_width)[::3]:
        assert robot.collision.contact(q) is None


@pytest.mark.parametrize("name", ["half, far over near", "diagonal from the far left"])
def test_neat_folds_are_plannable_from_voxels(
    planner: MotionPlanner, robot: RobotModel, task: Make, name: str
) -> None:
    """The network's coarse grid is enough to plan from."""
    axis = np.linspace(-0.2, 0.2, 150)
    x, y = np.meshgrid(axis, axis)
    points = np.column_stack([x.ravel(), y.ravel(), np.full(x.size, 0.002)])
    silhouette = Silhouette.from_voxel_grid(voxelise(points))
    plan = planner.plan_motion(task(*NEAT_FOLDS[name]), silhouette, _rest(robot))
    for grasp in plan.grasps.values():
        assert np.abs(np.abs(grasp.held_point_in_table) - 0.2).max() < 0.02


def test_the_edge_of_what_hides_the_cloth_is_no_hem(
    planner: MotionPlanner, robot: RobotModel, towel: Towel, task: Make
) -> None:
    """Beside hidden cells no hand grasps, neither at the edge that is seen nor at the corner."""
    cloth = towel()
    unknown = np.zeros_like(cloth.mask)
    unknown[: np.flatnonzero(cloth.mask.any(axis=1))[0] - 2] = (
        True  # what lies beyond the far side
    )
    hidden = replace(cloth, unknown=unknown)
    middle = task([[-0.19, 0.0]], [0.3, 0.0])
    assert planner.plan_motion(middle, cloth, _rest(robot)).grasps
    with pytest.raises(NoHemError, match="hides"):
        planner.plan_motion(middle, hidden, _rest(robot))
    corner = task([[-0.19, -0.19]], [0.3, 0.3])
    (grasp,) = planner.plan_motion(corner, hidden, _rest(robot)).grasps.values()
    assert grasp.hem.outward_normal == pytest.approx([0.0, -1.0], abs=0.05)


def test_segments_join(half_fold: MotionPlan, robot: RobotModel) -> None:
    """Each segment starts where the one before ended; the plan starts and ends at rest."""
    here = _rest(robot)
    for phase in half_fold.phases:
        for segment in phase.segments:
            names = segment.path.joint_names
            start = segment.path.positions(0.0)
            assert start == pytest.approx([here[name] for name in names], abs=1e-5)
            end = segment.path.positions(segment.path.length)
            here.update(zip(names, end, strict=True))
    rest = robot.rest_positions(["left", "right"])
    arrived = robot.arm_positions(["left", "right"], here)
    assert arrived == pytest.approx(rest, abs=1e-5)


def test_hands_do_not_cross(half_fold: MotionPlan) -> None:
    """The left arm takes the corner on the robot's left, y < 0 in the table frame."""
    assert half_fold.grasps["left"].held_point_in_table[1] < -0.15
    assert half_fold.grasps["right"].held_point_in_table[1] > 0.15


def test_order_of_points_is_immaterial(
    planner: MotionPlanner, robot: RobotModel, towel: Towel, task: Make, half_fold: MotionPlan
) -> None:
    """Swapping the two grasp points gives the same motion."""
    swapped = planner.plan_motion(task(*NEAT_FOLDS["half, points swapped"]), towel(), _rest(robot))
    assert swapped.duration == pytest.approx(half_fold.duration)
    for arm, grasp in half_fold.grasps.items():
        assert swapped.grasps[arm].position_in_table == pytest.approx(grasp.position_in_table)


def test_grip_is_inside_the_hem_at_the_fixed_height(
    half_fold: MotionPlan, robot: RobotModel
) -> None:
    """When the jaws close, the hands stand a little inside the corners, at the grip height."""
    end = _phase(half_fold, PhaseName.APPROACH).segments[-1].path
    positions = end.positions(end.length)
    for arm, part in (("left", slice(0, 6)), ("right", slice(6, 12))):
        tool = _tool_in_table(robot, arm, positions[part])
        assert tool[2, 3] == pytest.approx(GraspConfig().grip_height, abs=1e-5)
        corner = np.array([-0.2, np.sign(tool[1, 3]) * 0.2])
        assert np.linalg.norm(tool[:2, 3] - corner) == pytest.approx(
            GraspConfig().insertion, abs=0.002
        )


def test_hands_come_from_outside_the_cloth(
    planner: MotionPlanner, robot: RobotModel, towel: Towel, task: Make
) -> None:
    """On the last stretch to a side hem a hand moves inwards at the grip height."""
    plan = planner.plan_motion(task([[0.0, -0.2]], [0.0, 0.3]), towel(), _rest(robot))
    insert = _phase(plan, PhaseName.APPROACH).segments[-1].path
    start = _tool_in_table(robot, "left", insert.positions(0.0))
    assert start[1, 3] < -0.2 - 0.02
    assert start[2, 3] == pytest.approx(GraspConfig().grip_height, abs=1e-4)


@pytest.mark.parametrize("degrees", [-25.0, 20.0])
def test_a_direction_that_was_asked_for_is_taken(
    planner: MotionPlanner, robot: RobotModel, towel: Towel, degrees: float
) -> None:
    """By the hand it was asked of; the other one comes orthogonally to its hem, as usual."""
    angle = np.deg2rad(degrees)
    asked = np.array([[np.cos(angle), np.sin(angle)], [np.nan, np.nan]])
    points = np.array([[-0.2, -0.1], [-0.2, 0.1]])
    manipulation = Manipulation(points, np.array([0.4, 0.0]), asked)
    plan = planner.plan_motion(manipulation, towel(), _rest(robot))
    directions = [grasp.direction for grasp in plan.grasps.values()]
    assert directions[0] == pytest.approx(asked[0])
    assert directions[1] == pytest.approx([1.0, 0.0], abs=1e-6)
    grasp = next(iter(plan.grasps.values()))
    outside = grasp.at(0.03, 0.0)[:2, 3] - grasp.position_in_table[:2]
    assert outside == pytest.approx(-0.03 * asked[0])


def test_a_direction_out_of_the_cloth_is_refused(
    planner: MotionPlanner, robot: RobotModel, towel: Towel
) -> None:
    """With the angle by which it is off, and what to do."""
    asked = np.array([[-1.0, 0.0], [np.nan, np.nan]])
    points = np.array([[-0.2, -0.1], [np.nan, np.nan]])
    manipulation = Manipulation(points, np.array([0.2, 0.0]), asked)
    with pytest.raises(NoHemError, match="off by .* degrees.*turn the direction"):
        planner.plan_motion(manipulation, towel(), _rest(robot))


def test_single_arm_leaves_the_other_at_rest(
    planner: MotionPlanner, robot: RobotModel, towel: Towel, task: Make
) -> None:
    """One grasp point moves one arm only."""
    plan = planner.plan_motion(task([[-0.1, -0.2]], [0.0, 0.2]), towel(), _rest(robot))
    assert set(plan.grasps) == {"left"}
    moved = {n for p in plan.phases for s in p.segments for n in s.path.joint_names}
    assert moved == set(robot.joint_names(["left"]))


def test_stray_arm_is_brought_to_rest(
    planner: MotionPlanner, robot: RobotModel, towel: Towel, task: Make
) -> None:
    """An unused arm that is not at rest goes there on the approach."""
    posture = _rest(robot)
    posture["RARM_JOINT0"] += 0.2
    plan = planner.plan_motion(task([[-0.1, -0.2]], [0.0, 0.2]), towel(), posture)
    approach = _phase(plan, PhaseName.APPROACH).segments
    last = next(s for s in reversed(approach) if "RARM_JOINT0" in s.path.joint_names)
    index = last.path.joint_names.index("RARM_JOINT0")
    end = last.path.positions(last.path.length)[index]
    assert end == pytest.approx(robot.description.rest["RARM_JOINT0"], abs=1e-6)


def test_second_hem_serves_when_the_nearest_cannot(
    robot: RobotModel, towel: Towel, task: Make
) -> None:
    """If the nearest hem needs an impossible posture, the next one is taken (paper, V-B)."""
    config = replace(
        robot.config,
        grasp=replace(robot.config.grasp, tilts=(0.0,), yaw_deviations=(0.0,)),
        hem=replace(robot.config.hem, max_distance_inside=0.3, candidates=4),
    )
    # The middle of the far hem is out of reach of both vertical hands; a side hem is not.
    plan = MotionPlanner(robot, config).plan_motion(
        task([[-0.14, -0.05]], [0.15, 0.0]), towel(0.0, 0.46), _rest(robot)
    )
    (grasp,) = plan.grasps.values()
    assert abs(grasp.hem.outward_normal[1]) > 0.9
    assert grasp.hem.distance > 0.1


def test_crease_stays_where_the_plan_put_it(
    planner: MotionPlanner, robot: RobotModel, towel: Towel, task: Make
) -> None:
    """A grasp point inside the cloth is moved to the hem and the displacement lengthened."""
    plan = planner.plan_motion(task([[-0.16, -0.1]], [0.16, 0.0]), towel(), _rest(robot))
    (grasp,) = plan.grasps.values()
    (displacement,) = plan.displacements_in_table.values()
    span = float(np.linalg.norm(displacement)) + 2 * GraspConfig().jaw_depth
    assert grasp.held_point_in_table[0] + span / 2 == pytest.approx(-0.16 + 0.08, abs=1e-6)


def test_crease_correction_can_be_switched_off(
    robot: RobotModel, towel: Towel, task: Make
) -> None:
    """Without it the hands move by exactly the planned displacement."""
    config = replace(robot.config, grasp=replace(robot.config.grasp, keep_crease=False))
    plan = MotionPlanner(robot, config).plan_motion(
        task([[-0.16, -0.1]], [0.16, 0.0]), towel(), _rest(robot)
    )
    assert plan.displacements_in_table["left"] == pytest.approx([0.16, 0.0])
    poses = plan.via_poses_in_table["left"]
    assert poses[-1, :2, 3] - poses[0, :2, 3] == pytest.approx([0.16, 0.0], abs=1e-9)


def test_release_stays_above_a_pile(
    planner: MotionPlanner, robot: RobotModel, towel: Towel, task: Make
) -> None:
    """Where cloth lies high at the release point, the hand lets go above it."""
    flat = towel()
    heights = np.where(flat.mask, 0.003, 0.0)
    heights[180:230, 60:150] = 0.05
    piled = Silhouette(flat.mask | (heights > 0), flat.resolution, flat.origin_in_table, heights)
    plan = planner.plan_motion(task([[-0.19, -0.1]], [0.23, 0.0]), piled, _rest(robot))
    release = plan.via_poses_in_table["left"][-1, 2, 3]
    assert release == pytest.approx(0.05 + PathConfig().release_clearance)


def test_grasp_out_of_reach_is_refused_with_reasons(
    planner: MotionPlanner, robot: RobotModel, towel: Towel, task: Make
) -> None:
    """Beyond the arms' reach every hem is named with how near the arms come."""
    far = towel(0.0, 0.5)
    with pytest.raises(OutOfReachError, match=r"hem 1.*mm"):
        planner.plan_motion(task([[-0.25, 0.0]], [-0.05, 0.0]), far, _rest(robot))


def test_release_out_of_reach_is_refused(
    planner: MotionPlanner, robot: RobotModel, towel: Towel, task: Make
) -> None:
    """A grasp within reach whose release is not is refused before anything moves."""
    with pytest.raises((OutOfReachError, CollisionError)):
        planner.plan_motion(task([[-0.1, -0.2]], [0.0, 0.9]), towel(), _rest(robot))


def test_hands_that_would_meet_are_refused(
    planner: MotionPlanner, robot: RobotModel, towel: Towel, task: Make
) -> None:
    """Two grasp points closer together than the hands are wide cannot both be gripped."""
    with pytest.raises((CollisionError, OutOfReachError)):
        planner.plan_motion(task([[-0.1, -0.2], [-0.08, -0.2]], [0.0, 0.2]), towel(), _rest(robot))


def test_grasp_beside_the_cloth_has_no_hem(
    planner: MotionPlanner, robot: RobotModel, towel: Towel, task: Make
) -> None:
    """A grasp far beside the cloth is refused as such."""
    with pytest.raises(NoHemError):
        planner.plan_motion(task([[0.3, 0.3]], [-0.1, 0.0]), towel(), _rest(robot))


def test_tiny_displacement_is_refused(
    planner: MotionPlanner, robot: RobotModel, towel: Towel, task: Make
) -> None:
    """A displacement that would do nothing is refused."""
    with pytest.raises(InvalidInputError, match="displacement"):
        planner.plan_motion(task([[0.0, -0.2]], [0.001, 0.0]), towel(), _rest(robot))


def test_missing_joint_is_refused(
    planner: MotionPlanner, robot: RobotModel, towel: Towel, task: Make
) -> None:
    """Planning needs to know where every arm joint is."""
    posture = _rest(robot)
    del posture["LARM_JOINT3"]
    with pytest.raises(InvalidInputError, match="LARM_JOINT3"):
        planner.plan_motion(task([[0.0, -0.2]], [0.0, 0.2]), towel(), posture)


def test_same_task_same_plan(
    planner: MotionPlanner, robot: RobotModel, towel: Towel, task: Make, half_fold: MotionPlan
) -> None:
    """Planning twice gives bit-identical trajectories (paper, IV-B: reproducible)."""
    again = planner.plan_motion(task(*NEAT_FOLDS["half, far over near"]), towel(), _rest(robot))
    for one, other in zip(half_fold.phases, again.phases, strict=True):
        for a, b in zip(one.trajectories(0.02), other.trajectories(0.02), strict=True):
            assert np.array_equal(a.positions, b.positions)


def test_vertical_shape_is_plannable_too(robot: RobotModel, towel: Towel, task: Make) -> None:
    """The paper's plain path, up, across and down, is available."""
    config = replace(robot.config, path=replace(robot.config.path, lift_shape="vertical"))
    plan = MotionPlanner(robot, config).plan_motion(
        task([[0.0, -0.2]], [0.0, 0.2]), towel(), _rest(robot)
    )
    poses = plan.via_poses_in_table["left"]
    assert poses[3, :2, 3] == pytest.approx(poses[0, :2, 3], abs=1e-3)
    assert isinstance(config, MotionConfig)


def test_way_home_from_anywhere(
    planner: MotionPlanner, robot: RobotModel, half_fold: MotionPlan
) -> None:
    """From every phase of a fold the arms find home, low hands rising first."""
    carry = _phase(half_fold, PhaseName.CARRY).segments[0]
    height = robot.config.path.retreat_height - 0.002
    for share in (0.0, 0.02, 0.5, 1.0):
        posture = _rest(robot)
        positions = carry.path.positions(share * carry.path.length)
        posture.update(zip(carry.path.joint_names, positions, strict=True))
        plan = planner.plan_home(posture)
        last = plan.phases[-1]
        assert last.name is PhaseName.HOME
        end = last.segments[-1].path
        arms = ["left", "right"]
        assert end.positions(end.length) == pytest.approx(robot.rest_positions(arms), abs=1e-5)
        low = _tool_in_table(robot, "left", positions[:6])[2, 3] < height
        assert (plan.phases[0].name is PhaseName.RETREAT) == low


def test_home_opens_the_jaws_only_when_told(planner: MotionPlanner, robot: RobotModel) -> None:
    """By default nothing is dropped on the way home."""
    assert not any(p.gripper for p in planner.plan_home(_rest(robot)).phases)
    opened = planner.plan_home(_rest(robot), open_hands=True).phases[0]
    assert {command.arm for command in opened.gripper} == {"left", "right"}
