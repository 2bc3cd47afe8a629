"""A table that moves slowly is followed, a jump is told."""

import numpy as np
import pytest
from perception_scenes import head_camera_to_table
from scipy.spatial.transform import Rotation

from emd_core.errors import InvalidInputError
from emd_perception.table_tracker import TableState, TableTracker, TrackerConfig

START = head_camera_to_table()
RATE = 30.0


def plane_at(height: float, tilt: float = 0.0) -> np.ndarray:
    """The table's plane in the camera frame when it is higher by metres and tilted by radians."""
    moved = np.eye(4)
    moved[:3, :3] = Rotation.from_euler("x", tilt).as_matrix()
    moved[2, 3] = height
    return (np.linalg.inv(moved) @ START)[2]


def follow(tracker: TableTracker, heights, start: float = 0.0, noise: float = 0.0) -> list[str]:
    """Feed one plane a frame; gives the states."""
    rng = np.random.default_rng(0)
    return [
        tracker.update(plane_at(height + noise * rng.normal()), start + index / RATE)
        for index, height in enumerate(heights)
    ]


def test_a_table_at_rest_is_smoothed() -> None:
    """Noise of 1 mm a frame becomes a fifth of that."""
    tracker = TableTracker(START, TrackerConfig())
    follow(tracker, np.zeros(150), noise=0.001)
    drifts = []
    for index in range(150):
        tracker.update(plane_at(0.001 * np.random.default_rng(index).normal()), 5 + index / RATE)
        drifts.append(tracker.drift)
    assert tracker.state is TableState.FOLLOWED
    assert np.std(drifts) < 0.0003
    assert tracker.jumps == 0


def test_slow_drift_is_followed_any_distance() -> None:
    """4 mm a second for 15 s: 60 mm, twice what one frame's correction may be."""
    tracker = TableTracker(START, TrackerConfig())
    heights = np.linspace(0.0, 0.06, 450)
    states = follow(tracker, heights, noise=0.0005)
    assert set(states) == {TableState.FOLLOWED}
    assert tracker.drift == pytest.approx(0.06, abs=0.006)  # behind by the time constant
    follow(tracker, np.full(150, 0.06), start=15.0)
    assert tracker.drift == pytest.approx(0.06, abs=2e-4)
    np.testing.assert_allclose(tracker.transform_camera_to_table[2], plane_at(0.06), atol=2e-4)


def test_slow_tilt_is_followed() -> None:
    """3 degrees in 15 s."""
    tracker = TableTracker(START, TrackerConfig())
    for index, tilt in enumerate(np.radians(np.linspace(0.0, 3.0, 450))):
        assert tracker.update(plane_at(0.0, tilt), index / RATE) is TableState.FOLLOWED
    followed = tracker.transform_camera_to_table[2, :3]
    assert np.linalg.norm(np.cross(followed, plane_at(0.0, np.radians(3.0))[:3])) < 0.005


def test_a_jump_is_told_and_not_followed() -> None:
    """15 mm at once: doubted first, then a jump; the table that was followed stays."""
    tracker = TableTracker(START, TrackerConfig(jump_frames=3))
    follow(tracker, np.zeros(30))
    states = follow(tracker, np.full(10, 0.015), start=1.0)
    assert states[:2] == [TableState.DOUBTED] * 2
    assert set(states[2:]) == {TableState.JUMPED}
    assert tracker.jumps == 1
    assert tracker.offset == pytest.approx(0.015, abs=1e-4)
    assert tracker.drift == pytest.approx(0.0, abs=1e-6)
    assert follow(tracker, [0.0], start=2.0) == [TableState.FOLLOWED]


def test_a_single_wrong_measurement_is_no_jump() -> None:
    """It is counted and left out."""
    tracker = TableTracker(START, TrackerConfig())
    states = follow(tracker, [0.0, 0.0, 0.05, 0.0, 0.0])
    assert states.count(TableState.DOUBTED) == 1
    assert (tracker.jumps, tracker.blunders) == (0, 1)
    assert states[-1] is TableState.FOLLOWED


@pytest.mark.parametrize(
    ("height", "state"), [(0.02, "followed"), (0.05, "one measurement differs")]
)
def test_the_first_table_may_differ_more(height, state) -> None:
    """Extrinsics 20 mm off are corrected at once, 50 mm are not believed."""
    tracker = TableTracker(START, TrackerConfig())
    assert tracker.update(plane_at(height), 0.0) == state
    followed = height if state == TableState.FOLLOWED else 0.0
    assert tracker.drift == pytest.approx(followed, abs=1e-6)


def test_x_y_and_yaw_stay() -> None:
    """Only tilt and height are corrected: the table's origin stays over itself."""
    tracker = TableTracker(START, TrackerConfig())
    follow(tracker, np.linspace(0.0, 0.03, 300))
    error = tracker.transform_camera_to_table @ np.linalg.inv(START)
    np.testing.assert_allclose(error[:2, 3], 0.0, atol=1e-9)
    assert error[2, 3] == pytest.approx(-tracker.drift, abs=1e-6)


def test_the_same_frame_twice_counts_once() -> None:
    """A frame that is sent again changes nothing; nor does a clock that jumps back break it."""
    tracker = TableTracker(START, TrackerConfig(jump_frames=2))
    tracker.update(plane_at(0.0), 1.0)
    for _ in range(5):
        assert tracker.update(plane_at(0.05), 2.0) is TableState.DOUBTED
    assert tracker.update(plane_at(0.0), -100.0) is TableState.FOLLOWED


@pytest.mark.parametrize("arguments", [{"time_constant": -1.0}, {"jump_frames": 0}])
def test_settings_out_of_range_are_refused(arguments) -> None:
    """By name."""
    with pytest.raises(InvalidInputError, match=next(iter(arguments))):
        TrackerConfig(**arguments)
