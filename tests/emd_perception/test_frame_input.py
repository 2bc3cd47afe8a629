"""What cameras give becomes a registered, straight pair; the cloth is found in all of it."""

import cv2
import numpy as np
import pytest
from perception_scenes import Scene
from scipy.spatial.transform import Rotation

from emd_core.errors import InvalidInputError
from emd_core.frames import inverse_transform
from emd_core.lens_distortion import LensDistortion
from emd_core.metrics import voxel_mse
from emd_core.pinhole_camera import PinholeCamera
from emd_perception.depth_image import depth_in_metres
from emd_perception.frame_input import CalibratedCamera, FrameAligner, InputConfig
from emd_perception.lens import distort_points, pixel_directions
from emd_perception.pipeline import perceive
from emd_perception.registration import draw_depth

CAMERA = PinholeCamera()
LENS = LensDistortion("plumb_bob", (0.1, -0.2, 0.001, -0.001, 0.05))
POSITION, TURN = (0.025, 0.001, 0.002), (0.004, -0.006, 0.002)
QUATERNION = tuple(Rotation.from_rotvec(TURN).as_quat())


def bend(image: np.ndarray, camera: PinholeCamera, interpolation: int) -> np.ndarray:
    """What a camera with the lens sees of a straight picture."""
    directions = pixel_directions(camera, LENS).reshape(-1, 2)
    sources = distort_points(directions, camera, LensDistortion()).astype(np.float32)
    maps = sources.reshape(camera.height, camera.width, 2)
    return cv2.remap(image, maps[..., 0], maps[..., 1], interpolation)


def assert_sees(scene: Scene, aligner: FrameAligner, colour, depth, limit: float = 0.004) -> None:
    """Perception finds the true grid in an aligned frame."""
    found = perceive(
        aligner.colour(colour), depth, aligner.camera, scene.transform_camera_to_table
    )
    assert voxel_mse(found.voxel_grid, scene.grid) < limit


def test_a_registered_straight_pair_goes_through_untouched(flat_scene) -> None:
    """Nothing is copied or interpolated."""
    aligner = FrameAligner(InputConfig(), CalibratedCamera(CAMERA))
    depth = flat_scene.depth_frames[0]
    assert aligner.depth(depth) is depth
    assert aligner.colour(flat_scene.colour) is flat_scene.colour


def test_both_encodings_of_depth_give_the_same_grid(flat_scene) -> None:
    """16UC1 millimetres and 32FC1 metres of a frame: the rounding costs at most a few voxels."""
    metres = flat_scene.depth_frames[0]
    millimetres = np.nan_to_num(np.rint(metres * 1000.0)).astype(np.uint16)
    for depth in (depth_in_metres(metres, "32FC1"), depth_in_metres(millimetres, "16UC1")):
        assert_sees(flat_scene, FrameAligner(InputConfig(), CalibratedCamera(CAMERA)),
                    flat_scene.colour, depth)  # fmt: skip


def test_a_lens_is_taken_out_of_colour_and_depth(flat_scene) -> None:
    """Registered images through a lens that bends 8 pixels; ignoring it is visibly worse."""
    colour = bend(flat_scene.colour, CAMERA, cv2.INTER_LINEAR)
    depth = bend(flat_scene.depth_frames[0], CAMERA, cv2.INTER_NEAREST)
    aligner = FrameAligner(InputConfig(), CalibratedCamera(CAMERA, LENS))
    assert_sees(flat_scene, aligner, colour, aligner.depth(depth))
    blind = FrameAligner(InputConfig(rectified=True), CalibratedCamera(CAMERA, LENS))
    assert blind.depth(depth) is depth
    assert np.abs(aligner.colour(colour).astype(int) - blind.colour(colour)).mean() > 1.0


@pytest.mark.parametrize("scale", [0.5, 1.0])
def test_depth_of_a_camera_of_its_own_is_registered(flat_scene, scale) -> None:
    """Another place, turn, focal length, resolution and lens: the grid is the same."""
    camera = PinholeCamera(
        int(640 * scale), int(480 * scale), 570 * scale, 570 * scale, 314 * scale, 235 * scale
    )
    config = InputConfig("unregistered", False, POSITION, QUATERNION)
    points = CAMERA.unproject(flat_scene.depth_frames[0])
    to_depth = inverse_transform(config.transform_depth_to_colour)
    depth = bend(draw_depth(points, camera, to_depth), camera, cv2.INTER_NEAREST)
    aligner = FrameAligner(config, CalibratedCamera(CAMERA), CalibratedCamera(camera, LENS))
    assert_sees(flat_scene, aligner, flat_scene.colour, aligner.depth(depth))


@pytest.mark.parametrize("organised", [True, False])
def test_a_point_cloud_serves_as_depth(flat_scene, organised) -> None:
    """In order or as a list without the unknown points, in a frame of its own."""
    config = InputConfig("points", False, POSITION, QUATERNION)
    to_cloud = inverse_transform(config.transform_depth_to_colour)
    points = CAMERA.unproject(flat_scene.depth_frames[0]) @ to_cloud[:3, :3].T + to_cloud[:3, 3]
    if not organised:
        points = points[np.isfinite(points).all(axis=2)]
    aligner = FrameAligner(config, CalibratedCamera(CAMERA))
    assert_sees(flat_scene, aligner, flat_scene.colour, aligner.depth_of_points(points))


@pytest.mark.parametrize("size", [(320, 240), (1280, 960), (424, 318)])
def test_any_resolution_shows_the_cloth(flat_scene, size) -> None:
    """Half, double and an odd resolution of both images."""
    scale = size[0] / 640
    camera = PinholeCamera(*size, 525 * scale, 525 * scale, 320 * scale - 0.5, 240 * scale - 0.5)
    depth = cv2.resize(flat_scene.depth_frames[0], size, interpolation=cv2.INTER_NEAREST)
    colour = cv2.resize(flat_scene.colour, size, interpolation=cv2.INTER_AREA)
    aligner = FrameAligner(InputConfig(), CalibratedCamera(camera))
    assert_sees(flat_scene, aligner, colour, aligner.depth(depth), limit=0.005)


@pytest.mark.parametrize(
    ("arguments", "complaint"),
    [
        ({"depth": "stereo"}, "registered"),
        ({"depth": "points", "depth_orientation": (0.0, 0.0, 0.0, 0.0)}, "quaternion"),
        ({"depth": "points", "depth_position": (np.nan, 0.0, 0.0)}, "finite"),
        ({"depth_position": (0.02, 0.0, 0.0)}, "unregistered"),
    ],
)
def test_wrong_settings_are_refused(arguments, complaint) -> None:
    """Unknown sources, broken poses, and a pose for what is registered already."""
    with pytest.raises(InvalidInputError, match=complaint):
        InputConfig(**arguments)


def test_images_of_another_size_are_refused() -> None:
    """The error names both sizes and the remedy."""
    aligner = FrameAligner(InputConfig(), CalibratedCamera(CAMERA))
    with pytest.raises(InvalidInputError, match="320 x 240.*640 x 480.*unregistered"):
        aligner.depth(np.ones((240, 320), np.float32))
    with pytest.raises(InvalidInputError, match="colour image"):
        aligner.colour(np.zeros((240, 320, 3), np.uint8))
    with pytest.raises(InvalidInputError, match="calibration of its own"):
        FrameAligner(InputConfig("unregistered"), CalibratedCamera(CAMERA))
    with pytest.raises(InvalidInputError, match="points"):
        aligner.depth_of_points(np.zeros((4, 2)))
