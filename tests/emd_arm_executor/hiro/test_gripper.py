"""The opening law of the hands."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from emd_arm_executor.hiro.description import JOINT_LIMITS
from emd_arm_executor.hiro.figures.shapes import NAIL_WIDTH
from emd_arm_executor.hiro.gripper import GripperGeometry
from emd_core.errors import InvalidInputError

GRIPPER = GripperGeometry()


@given(st.floats(0.0, 0.109))
def test_width_and_joints_are_inverse(width: float) -> None:
    """Angles for a width give that width back."""
    assert GRIPPER.width_from_joints(GRIPPER.joints_from_width(width)) == pytest.approx(
        width, abs=1e-12
    )


@given(st.floats(0.0, 0.109))
def test_law_is_the_published_one(width: float) -> None:
    """Joints are (a, -a, -a, a) with sin a = (w / 2 - 16 mm) / 41.9 mm (HIRO's client)."""
    angles = GRIPPER.joints_from_width(width)
    assert angles == pytest.approx(angles[0] * np.array([1, -1, -1, 1]))
    assert np.sin(angles[0]) == pytest.approx((width / 2 - 0.016) / 0.0419, abs=1e-9)


@pytest.mark.parametrize("width", [0.0, 0.03, 0.1])
def test_angles_are_inside_the_limits(width: float) -> None:
    """The jaws can close and open to 100 mm within the hand's limits."""
    for number, angle in enumerate(GRIPPER.joints_from_width(width)):
        limits = JOINT_LIMITS[f"LHAND_JOINT{number}"]
        assert limits.lower < angle < limits.upper


@pytest.mark.parametrize("width", [-0.001, 0.12, float("nan")])
def test_impossible_widths_are_refused(width: float) -> None:
    """A width outside 0..109.7 mm raises."""
    with pytest.raises(InvalidInputError, match="gripper opens"):
        GRIPPER.joints_from_width(width)


def test_tips_move_on_a_circle(world) -> None:
    """`tip_advance` says how far the nail tips stand out, as forward kinematics has it."""
    for width in (0.0, 0.032, 0.1):
        world.set_joint_targets(
            {f"LHAND_JOINT{i}": a for i, a in enumerate(GRIPPER.joints_from_width(width))}
        )
        for _ in range(400):
            world.step()
        tip = world.transform_link_to_waist("LHAND_JOINT1_nail") @ (-0.058, 0.017, 0, 1)
        tool = world.transform_link_to_waist("left_tool")
        in_tool = np.linalg.inv(tool) @ tip
        assert in_tool[2] == pytest.approx(GRIPPER.tip_advance(width), abs=2e-4)
        assert abs(in_tool[0]) == pytest.approx(width / 2, abs=2e-4)


@given(st.floats(0.012, 0.05), st.floats(0.0, 0.012))
def test_fingers_enclose_what_the_nails_have_been_under(opened: float, width: float) -> None:
    """The box is as wide as the jaws are open and reaches as deep as the tips have been."""
    jaws = GRIPPER.enclosed(opened, width)
    passed = [GRIPPER.tip_advance(w) for w in np.linspace(width, opened, 200)]
    assert jaws.upper[2] == pytest.approx(max(passed), abs=1e-5)
    assert jaws.upper[0] - jaws.lower[0] == pytest.approx(width)
    assert jaws.upper[1] - jaws.lower[1] == pytest.approx(NAIL_WIDTH)
    assert -0.06 < jaws.lower[2] < -0.05
