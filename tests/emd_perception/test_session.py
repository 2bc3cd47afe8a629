"""Frame after frame: the table is followed, its jumps and wrong calibrations are told."""

import numpy as np
import pytest
from perception_scenes import Scene, head_camera_to_table

from emd_core.errors import NoClothError
from emd_core.pinhole_camera import PinholeCamera
from emd_perception.calibration.calibration import Calibration
from emd_perception.config import PerceptionConfig, SegmentationConfig
from emd_perception.frame_input import Frame
from emd_perception.health import Level
from emd_perception.session import PerceptionSession
from emd_perception.table_tracker import TrackerConfig
from emd_perception.table_watch import TableWatch

CAMERA = PinholeCamera()


def frame_of(scene: Scene, index: int = 0) -> Frame:
    """One of a scene's frames."""
    return Frame(scene.colour, scene.depth_frames[index % len(scene.depth_frames)], CAMERA)


def stored(height: float = 0.0) -> Calibration:
    """A calibration of the scenes' camera that has the table higher by metres than it is."""
    transform = head_camera_to_table()
    transform[2, 3] -= height
    return Calibration(CAMERA, transform, transform[2], 0.1, 60, 5, 0.0, 0.0, "today")


def test_a_stored_calibration_serves_and_is_checked(flat_scene) -> None:
    """The grid is as with the published pose; after some frames the check is passed."""
    session = PerceptionSession(TableWatch(stored()))
    for index in range(5):
        found = session.perceive([frame_of(flat_scene, index)], None, float(index))
    assert not any("no extrinsics" in note for note in found.notes)
    table, calibration = session.watch.health()
    assert (table.level, calibration.level) == (Level.OK, Level.OK)
    assert abs(float(calibration.values["offset_mm"])) < 2.0


def test_a_calibration_that_no_longer_holds_is_told(flat_scene) -> None:
    """A table 20 mm higher than stored: an error that names the remedy."""
    session = PerceptionSession(TableWatch(stored(-0.02)))
    for index in range(5):
        session.perceive([frame_of(flat_scene, index)], None, float(index))
    calibration = session.watch.health()[1]
    assert calibration.level is Level.ERROR
    assert "cell calibrate" in calibration.text
    assert float(calibration.values["offset_mm"]) == pytest.approx(20.0, abs=2.0)


def test_a_bare_table_is_watched_too(empty_scene) -> None:
    """No cloth is an error, but the table is measured."""
    session = PerceptionSession(TableWatch())
    with pytest.raises(NoClothError):
        session.perceive([frame_of(empty_scene)], empty_scene.transform_camera_to_table, 0.0)
    assert session.watch.health()[0].level is Level.OK


def test_a_jump_of_the_table_is_told(flat_scene) -> None:
    """The published pose has the table 20 mm lower than it is seen from the second frame on."""
    watch = TableWatch(tracker=TrackerConfig(jump_frames=2))
    session = PerceptionSession(watch)
    pose = flat_scene.transform_camera_to_table
    session.perceive([frame_of(flat_scene)], pose, 0.0)
    for stamp in (1.0, 2.0):
        raised = frame_of(flat_scene)
        slope = -pose[2, 2]
        nearer = (raised.depth - 0.02 / slope).astype(np.float32)
        session.perceive([Frame(raised.colour, nearer, CAMERA)], pose, stamp)
    health = watch.health()[0]
    assert health.level is Level.ERROR
    assert "jumped" in health.text


def test_the_same_frame_twice_gives_the_same_grid(flat_scene) -> None:
    """What the first time taught of the table does not change the second."""
    session = PerceptionSession(TableWatch())
    pose = flat_scene.transform_camera_to_table.copy()
    pose[2, 3] += 0.004
    session.perceive([frame_of(flat_scene, 0)], pose, 0.0)
    first, second = (session.perceive([frame_of(flat_scene, 1)], pose, 1.0) for _ in range(2))
    np.testing.assert_array_equal(first.voxel_grid.occupancy, second.voxel_grid.occupancy)
    np.testing.assert_array_equal(
        first.transform_camera_to_table, second.transform_camera_to_table
    )


def test_a_stream_keeps_what_it_learnt_of_the_colours(flat_scene) -> None:
    """Until the settings change; a capture neither uses it nor changes it."""
    session = PerceptionSession(TableWatch())
    pose = flat_scene.transform_camera_to_table

    def memory(config: PerceptionConfig | None = None, streaming: bool = True):
        frame = frame_of(flat_scene)
        found = session.perceive([frame], pose, 0.0, config, None, streaming).memory
        assert found is not None
        return found.outline.segmentation.memory

    first = memory()
    assert memory() is first
    assert memory(streaming=False) is not first
    assert memory() is first
    others = PerceptionConfig(SegmentationConfig(chroma_gain=2.0))
    assert memory(others) is not first


def test_without_extrinsics_it_says_so(flat_scene) -> None:
    """The table frame lies under the cloth; the health is a warning with the remedy."""
    session = PerceptionSession(TableWatch())
    session.perceive([frame_of(flat_scene)], None, 0.0)
    health = session.watch.health()[0]
    assert health.level is Level.WARN
    assert "calibrate" in health.text
