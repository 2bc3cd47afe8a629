"""Manipulations drawn on the picture."""

import numpy as np
import pytest

from emd_arm_executor.hiro.description import OBSERVE, transform_camera_to_table
from emd_console.cell_port import Check
from emd_console.projection import TableProjection
from emd_console.teaching import Lesson, Pixel, points_from
from emd_core.errors import InvalidInputError
from emd_core.pinhole_camera import PinholeCamera

HEAD = OBSERVE.by_joint()
PROJECTION = TableProjection(
    PinholeCamera(), transform_camera_to_table(HEAD["HEAD_JOINT0"], HEAD["HEAD_JOINT1"])
)


def pixel(x: float, y: float) -> Pixel:
    """Where a point of the table is in the picture."""
    column, row = PROJECTION.pixels(np.array([[x, y, 0.0]]))[0]
    return float(column), float(row)


def checked() -> Lesson:
    """Two hands that the executor would let come from the far side."""
    lesson = Lesson()
    lesson.drag(pixel(-0.2, -0.1), pixel(0.1, -0.1))
    lesson.add_hand(pixel(-0.2, 0.1))
    manipulation = lesson.manipulation(PROJECTION)
    lesson.check = Check(manipulation, ("left", "right"), np.array([[1.0, 0.0]] * 2))
    return lesson


def test_nothing_is_asked_of_the_hands_at_first() -> None:
    """The executor chooses whence they come, and says it."""
    lesson = checked()
    assert lesson.manipulation(PROJECTION).grasp_directions_in_table is None
    (point, direction), _ = lesson.grips(PROJECTION)
    assert np.allclose(point, [-0.2, -0.1], atol=1e-6) and direction.tolist() == [1.0, 0.0]


def test_a_hand_comes_from_its_handle() -> None:
    """The other one is left as it is, and what the executor said before counts no longer."""
    lesson = checked()
    lesson.turn(1, pixel(-0.25, 0.15), PROJECTION)
    asked = lesson.manipulation(PROJECTION).grasp_directions_in_table
    assert np.isnan(asked[0]).all()
    assert np.allclose(asked[1], np.array([1.0, -1.0]) / np.sqrt(2.0), atol=1e-6)
    assert lesson.check is None
    first, second = lesson.grips(PROJECTION)
    assert first is None and np.allclose(second[1], asked[1])


def test_a_hand_is_turned_by_an_angle_and_freed() -> None:
    """Counterclockwise as seen from above."""
    lesson = checked()
    lesson.turn_by(0, np.deg2rad(30.0), PROJECTION)
    assert np.allclose(lesson.directions[0], [np.cos(np.pi / 6), 0.5])
    lesson.turn_by(0, np.deg2rad(-30.0), PROJECTION)
    assert np.allclose(lesson.directions[0], [1.0, 0.0])
    lesson.free(0)
    assert lesson.manipulation(PROJECTION).grasp_directions_in_table is None


@pytest.mark.parametrize("hand", [-1, 2, 99])
def test_a_hand_that_is_not_there_is_not_turned(hand) -> None:
    """Nor one of which nobody knows where it grips."""
    with pytest.raises(InvalidInputError, match="draw a manipulation"):
        checked().turn(hand, pixel(0.0, 0.0), PROJECTION)
    lesson = Lesson()
    lesson.drag(pixel(-0.2, -0.1), pixel(0.1, -0.1))
    with pytest.raises(InvalidInputError, match="draw a manipulation"):
        lesson.turn_by(0, 0.1, PROJECTION)


def test_a_handle_at_the_hem_is_no_direction() -> None:
    """It is refused, and the direction stays."""
    lesson = checked()
    with pytest.raises(InvalidInputError, match="farther"):
        lesson.turn(0, pixel(-0.2, -0.1), PROJECTION)
    assert lesson.directions == [None, None] and lesson.check is not None


@pytest.mark.parametrize("sent", [None, [], {"points": 3}, {"points": [[1]]}, {"points": [["a"]]}])
def test_what_is_no_list_of_points_is_refused(sent) -> None:
    """Whatever a browser sends."""
    with pytest.raises(InvalidInputError):
        points_from(sent)
