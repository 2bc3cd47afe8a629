"""Tests of perception as a whole."""

import numpy as np
import pytest
from perception_scenes import BLUE, Layer, Scene, rectangle, render
from scipy.spatial.transform import Rotation

from emd_core.errors import InvalidInputError, NoClothError
from emd_core.frames import FieldOfView, transform_points
from emd_core.metrics import silhouette_iou, voxel_mse
from emd_core.pinhole_camera import PinholeCamera
from emd_perception.pipeline import Perception, perceive, perceive_frames

CAMERA = PinholeCamera()


def perceive_scene(scene: Scene, transform: np.ndarray | None = None) -> Perception:
    """Perceive all frames of a scene, with its true extrinsics unless others are given."""
    colours = [scene.colour] * len(scene.depth_frames)
    extrinsics = scene.transform_camera_to_table if transform is None else transform
    return perceive_frames(colours, scene.depth_frames, CAMERA, extrinsics)


def erring(scene: Scene, rotation_vector: list[float], height: float) -> np.ndarray:
    """The scene's extrinsics with an error."""
    error = np.eye(4)
    error[:3, :3] = Rotation.from_rotvec(rotation_vector).as_matrix()
    error[2, 3] = height
    return error @ scene.transform_camera_to_table


def test_the_grid_of_a_folded_cloth_matches_the_truth(folded_scene) -> None:
    """From noisy frames to the grid: two layers stay two layers, the silhouette stays."""
    found = perceive_scene(folded_scene)
    assert voxel_mse(found.voxel_grid, folded_scene.grid) < 0.003
    assert silhouette_iou(found.voxel_grid, folded_scene.grid) > 0.96
    assert found.quality > 0.9
    assert found.reason == "cloth found"


def test_one_frame_is_enough_for_the_silhouette(flat_scene) -> None:
    """A single frame gives the flat cloth to a few columns."""
    found = perceive(
        flat_scene.colour,
        flat_scene.depth_frames[0],
        CAMERA,
        flat_scene.transform_camera_to_table,
    )
    assert voxel_mse(found.voxel_grid, flat_scene.grid) < 0.002


def test_the_same_frames_give_the_same_result(folded_scene) -> None:
    """Two runs agree in every bit, but for the time they take."""
    first, second = (perceive_scene(folded_scene) for _ in range(2))
    for name in ("mask", "table_plane", "transform_camera_to_table", "points_in_table", "colours"):
        np.testing.assert_array_equal(getattr(first, name), getattr(second, name))
    np.testing.assert_array_equal(first.voxel_grid.occupancy, second.voxel_grid.occupancy)
    assert (first.quality, first.reason) == (second.quality, second.reason)


def test_the_measured_table_corrects_the_extrinsics(folded_scene) -> None:
    """Extrinsics tilted by 1.5 degrees and 8 mm too high give the same heights as true ones."""
    wrong = erring(folded_scene, [0.02, -0.015, 0.0], 0.008)
    found = perceive_scene(folded_scene, wrong)
    assert found.quality > 0.9
    assert voxel_mse(found.voxel_grid, folded_scene.grid) < 0.01
    height = found.voxel_grid.occupancy.sum(axis=2)
    assert (height[6:15, 6:26] == 1).mean() > 0.95
    assert (height[17:26, 6:26] == 2).mean() > 0.95


def test_extrinsics_that_contradict_the_table_lower_the_quality(flat_scene) -> None:
    """A camera pose 8 degrees off is not corrected silently."""
    found = perceive_scene(flat_scene, erring(flat_scene, [0.14, 0.0, 0.0], 0.0))
    assert found.quality < 0.4
    assert "extrinsics" in found.reason


def test_the_plane_is_that_of_the_true_table(flat_scene) -> None:
    """The measured plane is the true table to a millimetre and 2 mrad."""
    truth = flat_scene.transform_camera_to_table[2]
    found = perceive_scene(flat_scene).table_plane
    np.testing.assert_allclose(found[:3], truth[:3], atol=2e-3)
    assert found[3] == pytest.approx(truth[3], abs=1e-3)


def test_without_extrinsics_the_table_frame_lies_under_the_cloth(flat_scene) -> None:
    """The cloth's points surround the origin at their height over z = 0, and notes say so."""
    found = perceive(flat_scene.colour, flat_scene.depth_frames[0], CAMERA)
    assert np.abs(found.points_in_table[:, :2].mean(axis=0)).max() < 0.01
    assert np.median(found.points_in_table[:, 2]) == pytest.approx(0.003, abs=1e-3)
    assert any("no extrinsics" in note for note in found.notes)
    assert found.voxel_grid.silhouette.sum() == pytest.approx(
        flat_scene.grid.silhouette.sum(), rel=0.05
    )


def test_a_field_of_view_grows_only_where_nobody_chose_it() -> None:
    """Without extrinsics the box grows around a large cloth; one that was asked for does not."""
    large = render([Layer(rectangle(0.55, 0.55), 0.003, BLUE)], seed=30)
    depth = large.depth_frames[0]
    grown = perceive(large.colour, depth, CAMERA)
    assert grown.voxel_grid.field_of_view.half_extent > FieldOfView().half_extent
    assert any("enlarged" in note for note in grown.notes)
    assert not grown.voxel_grid.silhouette[0].any()
    assert not grown.voxel_grid.silhouette[:, 0].any()
    chosen = perceive(large.colour, depth, CAMERA, field_of_view=FieldOfView(0.25))
    assert chosen.voxel_grid.field_of_view.half_extent == 0.25
    assert chosen.quality < 0.9
    assert "outside the field of view" in chosen.reason


def test_a_moving_scene_lowers_the_quality(flat_scene) -> None:
    """Frames between which the cloth moved are not averaged silently."""
    layers = [Layer(rectangle(0.4, 0.4, (0.05, 0.05), turn=0.2), 0.003, BLUE)]
    moved = render(layers, frames=3)
    found = perceive_frames(
        [flat_scene.colour] * 3 + [moved.colour] * 3,
        [*flat_scene.depth_frames, *moved.depth_frames],
        CAMERA,
        flat_scene.transform_camera_to_table,
    )
    assert found.quality < 0.3
    assert "moved" in found.reason


def test_points_are_in_the_frame_of_the_transform(flat_scene) -> None:
    """The points' heights over the measured plane are their z."""
    found = perceive_scene(flat_scene)
    transform_table_to_camera = np.linalg.inv(found.transform_camera_to_table)
    in_camera = transform_points(transform_table_to_camera, found.points_in_table)
    heights = in_camera @ found.table_plane[:3] + found.table_plane[3]
    np.testing.assert_allclose(heights, found.points_in_table[:, 2], atol=1e-9)


def test_an_empty_table_is_no_cloth(empty_scene) -> None:
    """Nothing on the table is an error of its own, not an empty grid."""
    with pytest.raises(NoClothError):
        perceive_scene(empty_scene)


def test_stages_are_timed(flat_scene) -> None:
    """Every stage has its milliseconds, together not more than the total."""
    times = dict(perceive_scene(flat_scene).milliseconds)
    total = times.pop("total")
    stages = {"fusion", "glance", "plane", "segmentation", "table_frame", "voxelisation"}
    assert set(times) == stages
    assert all(value >= 0 for value in times.values())
    assert sum(times.values()) <= total


def test_input_that_does_not_fit_is_refused(flat_scene) -> None:
    """Another size, other counts and broken extrinsics are refused by name."""
    colour, depth = flat_scene.colour, flat_scene.depth_frames[0]
    with pytest.raises(InvalidInputError, match="same size"):
        perceive(colour, depth[:100], CAMERA)
    with pytest.raises(InvalidInputError, match="intrinsics"):
        perceive(colour, depth, PinholeCamera(320, 240))
    with pytest.raises(InvalidInputError, match="rotation"):
        perceive(colour, depth, CAMERA, 2.0 * np.eye(4))
    with pytest.raises(InvalidInputError, match="as many"):
        perceive_frames([colour], [depth, depth], CAMERA)
    with pytest.raises(InvalidInputError, match="at least one"):
        perceive_frames([], [], CAMERA)
