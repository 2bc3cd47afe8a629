"""Columns that a hand hides are unknown, all others known: against rays cast at the scene."""

import numpy as np
from perception_scenes import GREY, WHITE, Layer, Scene, rectangle, render

from emd_core.frames import FieldOfView
from emd_core.pinhole_camera import PinholeCamera
from emd_perception.hidden_columns import hidden_columns
from emd_perception.perception import Perception
from emd_perception.pipeline import perceive
from emd_perception.unprojection import pixel_rays

CAMERA, FIELD_OF_VIEW = PinholeCamera(), FieldOfView()
HAND = (
    Layer(rectangle(0.18, 0.08, (0.16, 0.10), 0.3), 0.06, GREY, is_cloth=False),
    Layer(rectangle(0.3, 0.1, (0.32, 0.14), 0.3), 0.14, GREY, is_cloth=False),
)


def perceived(scene: Scene) -> Perception:
    """What is made of its first frame."""
    return perceive(scene.colour, scene.depth_frames[0], CAMERA, scene.transform_camera_to_table)


def pixels_behind(scene: Scene, pixels: np.ndarray) -> np.ndarray:
    """How many of some pixels, shape (H, W), look at each column of the table."""
    pose = scene.transform_camera_to_table
    rays = pixel_rays(CAMERA)[pixels] @ pose[:3, :3].T
    points = pose[:3, 3] - rays * (pose[2, 3] / rays[:, 2])[:, None]
    edges = np.linspace(-FIELD_OF_VIEW.half_extent, FIELD_OF_VIEW.half_extent, 33)
    return np.histogram2d(points[:, 0], points[:, 1], bins=(edges, edges))[0]


def hand_pixels(scene: Scene) -> np.ndarray:
    """Pixels that show the hand, shape (H, W): what is higher than any cloth of the scene."""
    pose = scene.transform_camera_to_table
    heights = (CAMERA.unproject(scene.true_depth) @ pose[:3, :3].T + pose[:3, 3])[..., 2]
    return np.asarray(heights > 0.03)


def test_no_column_behind_a_hand_reads_as_empty_table() -> None:
    """A hand over the cloth: what it hides of the cloth is known as cloth or told as unknown."""
    scene = render([Layer(rectangle(0.4, 0.4, turn=0.2), 0.003, WHITE), *HAND], seed=5)
    found = perceived(scene).voxel_grid
    behind, seen = (pixels_behind(scene, one) for one in (hand_pixels(scene), scene.mask))
    hidden = scene.grid.silhouette & (behind > 0.5 * (behind + seen)) & (behind > 10)
    assert hidden.sum() > 30
    assert (found.unknown | found.silhouette)[hidden].mean() > 0.97
    assert found.unknown[hidden].mean() > 0.9


def test_what_no_hand_hides_is_known() -> None:
    """Columns of which the hand hides nothing are known, one beside its outline apart."""
    scene = render([Layer(rectangle(0.4, 0.4, turn=0.2), 0.003, WHITE), *HAND], seed=5)
    found = perceived(scene)
    near = np.pad(pixels_behind(scene, hand_pixels(scene)) > 0, 1)
    near = sum(np.roll(near, (i, j), (0, 1)) for i in (-1, 0, 1) for j in (-1, 0, 1))[1:-1, 1:-1]
    assert 200 < (near == 0).sum()
    assert not found.voxel_grid.unknown[near == 0].any()
    told = [note for note in found.notes if "unknown" in note]
    assert told == [
        f"{found.voxel_grid.unknown_count} columns are unknown: something tall or too near hides "
        "them"
    ]


def test_without_a_hand_all_is_known(flat_scene) -> None:
    """A cloth alone on its table hides nothing, and nothing is said of it."""
    found = perceived(flat_scene)
    assert found.voxel_grid.unknown_count == 0
    assert not any("unknown" in note for note in found.notes)


def test_a_column_of_which_cloth_is_seen_is_known(flat_scene) -> None:
    """Where more pixels of a column show cloth than are hidden, the hand's edge does not count."""
    pose = flat_scene.transform_camera_to_table
    rows, columns = np.mgrid[: CAMERA.height, : CAMERA.width]
    middle = 8 * columns > 8 * 300 + rows
    alone = hidden_columns(middle, np.zeros_like(middle), CAMERA, pose, FIELD_OF_VIEW)
    beside = hidden_columns(middle, ~middle, CAMERA, pose, FIELD_OF_VIEW)
    shares = pixels_behind(flat_scene, middle) / pixels_behind(flat_scene, middle | ~middle)
    # Every fourth pixel is counted: shares are told to a few percent.
    for found, limit in ((alone, 0.1), (beside, 0.5)):
        clear = np.abs(shares - limit) > 0.08
        assert clear.mean() > 0.95
        np.testing.assert_array_equal(found[clear], (shares > limit)[clear])
    assert beside.sum() < alone.sum()
