"""Tests of points and voxels from masked depth."""

import numpy as np
import pytest
from perception_scenes import BLUE, Layer, Scene, head_camera_to_table, rectangle, render

from emd_core.errors import NoClothError
from emd_core.frames import FieldOfView, transform_points
from emd_core.metrics import silhouette_iou, voxel_mse
from emd_core.pinhole_camera import PinholeCamera
from emd_core.voxel_grid import VoxelGrid, voxelise
from emd_perception.cloth_points import ClothPoints, cloth_points
from emd_perception.config import FusionConfig
from emd_perception.depth_to_voxel import cells_per_voxel, voxelise_cloth
from emd_perception.fusion import trimmed_mean
from emd_perception.unprojection import unproject_mask

CAMERA = PinholeCamera()
FIELD_OF_VIEW = FieldOfView()


def points(scene: Scene, depth: np.ndarray, mask: np.ndarray | None = None) -> ClothPoints:
    """Points of a scene with true mask and true extrinsics."""
    return cloth_points(
        scene.colour,
        depth,
        scene.mask if mask is None else mask,
        CAMERA,
        scene.transform_camera_to_table,
        spacing=0.0045,
    )


def grid(scene: Scene, depth: np.ndarray) -> VoxelGrid:
    """Grid of a scene with true mask and true extrinsics."""
    return voxelise_cloth(points(scene, depth), FIELD_OF_VIEW)


def fused(scene: Scene) -> np.ndarray:
    """Trimmed mean of all frames of a scene."""
    return trimmed_mean(np.stack(scene.depth_frames), FusionConfig())


def test_one_and_two_layers_fall_into_their_voxel_layers(folded_scene) -> None:
    """Under a Kinect's noise, 3 mm of cloth lie in voxel layer 0 and 6 mm in layer 1."""
    height = grid(folded_scene, fused(folded_scene)).occupancy.sum(axis=2)
    assert (height[6:15, 6:26] == 1).mean() > 0.98
    assert (height[17:26, 6:26] == 2).mean() > 0.98
    assert height.max() == 2


def test_the_grid_matches_the_truth(folded_scene) -> None:
    """Of 16384 voxels fewer than one in 500 differs from the truth, and few columns."""
    found = grid(folded_scene, fused(folded_scene))
    assert voxel_mse(found, folded_scene.grid) < 0.002
    assert silhouette_iou(found, folded_scene.grid) > 0.97


def test_averaging_beats_the_rule_of_any_point(folded_scene) -> None:
    """On single noisy pixels "one point suffices" takes the highest error; averages do not."""
    scene = folded_scene
    in_camera = unproject_mask(scene.depth_frames[0], scene.mask, CAMERA)
    raw = voxelise(transform_points(scene.transform_camera_to_table, in_camera), FIELD_OF_VIEW)
    averaged = grid(scene, scene.depth_frames[0])
    raw_error, error = (voxel_mse(one, scene.grid) for one in (raw, averaged))
    assert error < 0.1 * raw_error


def test_cloth_without_depth_does_not_vanish(folded_scene) -> None:
    """Where a hole in the depth spans several columns, they take their neighbours' height."""
    depth = fused(folded_scene)
    transform = head_camera_to_table()
    in_table = transform_points(transform, CAMERA.unproject(folded_scene.true_depth))
    hole = (np.abs(in_table[..., 0] - 0.1) < 0.05) & (np.abs(in_table[..., 1]) < 0.05)
    depth[hole] = np.nan
    found = grid(folded_scene, depth)
    assert silhouette_iou(found, folded_scene.grid) > 0.97
    assert voxel_mse(found, folded_scene.grid) < 0.002


def test_cloth_without_any_depth_is_refused(flat_scene) -> None:
    """A mask without a single depth cannot become points."""
    depth = flat_scene.depth_frames[0].copy()
    depth[flat_scene.mask] = np.nan
    with pytest.raises(NoClothError, match="no pixel of it has a depth"):
        points(flat_scene, depth)


def test_flying_pixels_do_not_raise_columns(flat_scene) -> None:
    """One pixel in three hundred 10 cm too high changes hardly a column."""
    depth = flat_scene.depth_frames[0].copy()
    wild = np.random.default_rng(0).random(depth.shape) < 1 / 300
    depth[wild] -= 0.1
    height = grid(flat_scene, depth).occupancy.sum(axis=2)
    assert (height > 1).sum() < 0.02 * (height > 0).sum()


def test_points_lie_on_the_cloth_in_its_colour(flat_scene) -> None:
    """Averaged points keep to the cloth's height and colour, a few millimetres apart."""
    found = points(flat_scene, flat_scene.depth_frames[0])
    assert abs(np.median(found.points_in_table[:, 2]) - 0.003) < 5e-4
    assert found.points_in_table[:, 2].std() < 0.0015
    assert found.colours.shape == found.points_in_table.shape
    assert found.colours.dtype == np.uint8
    assert np.abs(np.median(found.colours, axis=0) - BLUE).max() < 40
    assert found.known_share > 0.95
    spacing = np.sqrt(0.16 / len(found.points_in_table))
    assert 0.003 < spacing < 0.006


def test_cloth_beyond_the_border_wraps() -> None:
    """Cloth that leaves the field of view on one side comes in on the other (paper, III-A)."""
    beyond = Layer(rectangle(0.2, 0.2, (0.0, 0.3)), 0.003, BLUE)
    scene = render([beyond], seed=21)
    found = grid(scene, scene.depth_frames[0])
    assert found.silhouette[16, 30]
    assert found.silhouette[16, 2]
    assert silhouette_iou(found, scene.grid) > 0.93


def test_a_scrap_smaller_than_a_column_still_occupies_one() -> None:
    """A single pixel of cloth is a column of cloth."""
    scene = render([], seed=22)
    mask = np.zeros((480, 640), bool)
    mask[240, 320] = True
    cloth = points(scene, scene.true_depth.astype(np.float32), mask)
    assert voxelise_cloth(cloth, FIELD_OF_VIEW).silhouette.sum() == 1


def test_columns_are_divided_the_finer_the_less_noise_there_is(folded_scene) -> None:
    """Many frames tell heights of smaller cells than one frame does."""
    one, many = folded_scene.depth_frames[0], fused(folded_scene)
    divisions = [cells_per_voxel(points(folded_scene, d), FIELD_OF_VIEW) for d in (one, many)]
    assert divisions[0] < divisions[1]
