"""Messages and core types: there and back again, and what is refused."""

import numpy as np
import pytest
from geometry_msgs.msg import Point, Vector3
from sensor_msgs.msg import CameraInfo
from std_msgs.msg import Header

from emd_core.errors import CellError, ErrorCode, InvalidInputError, error_from_code
from emd_core.frames import FieldOfView, transform_from_pose
from emd_core.independent_manipulation import IndependentManipulation
from emd_core.lens_distortion import LensDistortion
from emd_core.manipulation import Manipulation
from emd_core.pinhole_camera import PinholeCamera
from emd_core.ros import conversions
from emd_core.voxel_grid import VoxelGrid
from emd_msgs_py.msg import ErrorCode as ErrorCodeMsg
from emd_msgs_py.msg import Manipulation as ManipulationMsg
from emd_msgs_py.msg import VoxelGrid as VoxelGridMsg

HEADER = Header(frame_id=conversions.TABLE_FRAME)
CAMERA = PinholeCamera(640, 480, 525.0, 530.0, 319.0, 241.0)


def random_grid() -> VoxelGrid:
    """A grid of uncommon size, so that packing has a remainder."""
    fov = FieldOfView(0.3, 0.5, (9, 7, 5))
    return VoxelGrid(np.random.default_rng(0).random(fov.size) < 0.3, fov)


def test_voxel_grid_there_and_back_again() -> None:
    """Occupancy and metric size survive."""
    grid = random_grid()
    again = conversions.voxel_grid_from_message(conversions.voxel_grid_to_message(grid, HEADER))
    assert (again.occupancy == grid.occupancy).all()
    assert again.field_of_view == grid.field_of_view


def test_unknown_columns_there_and_back_again() -> None:
    """They travel with the grid, take no space where there are none, and must fit it."""
    grid = random_grid()
    unknown = np.random.default_rng(1).random(grid.occupancy.shape[:2]) < 0.2
    hidden = VoxelGrid(grid.occupancy, grid.field_of_view, unknown)
    message = conversions.voxel_grid_to_message(hidden, HEADER)
    np.testing.assert_array_equal(
        conversions.voxel_grid_from_message(message).unknown, hidden.unknown
    )
    assert len(conversions.voxel_grid_to_message(grid, HEADER).unknown) == 0
    message.unknown = message.unknown[:-1]
    with pytest.raises(InvalidInputError, match="unknown columns"):
        conversions.voxel_grid_from_message(message)


def test_a_plain_voxel_grid_is_read_too() -> None:
    """One byte a voxel says the same as one bit a voxel."""
    grid = random_grid()
    message = conversions.voxel_grid_to_message(grid, HEADER)
    message.encoding = VoxelGridMsg.PLAIN
    message.data = grid.occupancy.astype(np.uint8).ravel().tobytes()
    assert (conversions.voxel_grid_from_message(message).occupancy == grid.occupancy).all()


@pytest.mark.parametrize(
    "change",
    [
        {"size_x": 10},
        {"size_z": 0},
        {"data": b"\0"},
        {"encoding": 7},
        {"z_scale": float("nan")},
        {"half_extent": 0.0},
    ],
)
def test_inconsistent_voxel_grids_are_refused(change) -> None:
    """Sizes, scales and data must fit together."""
    message = conversions.voxel_grid_to_message(random_grid(), HEADER)
    for name, value in change.items():
        setattr(message, name, value)
    with pytest.raises(InvalidInputError):
        conversions.voxel_grid_from_message(message)


def test_manipulation_there_and_back_again() -> None:
    """Unused hands stay unused."""
    made = Manipulation(np.array([[0.1, -0.2], [np.nan, np.nan]]), np.array([0.0, 0.3]))
    again = conversions.manipulation_from_message(
        conversions.manipulation_to_message(made, HEADER)
    )
    assert again.used == made.used
    assert np.allclose(again.grasp_points_in_table, made.grasp_points_in_table, equal_nan=True)


def test_grasp_directions_there_and_back_again() -> None:
    """A free direction stays free, another one comes back as a unit vector; none is none."""
    points = np.array([[0.1, -0.2], [0.1, 0.2]])
    asked = np.array([[0.6, -0.8], [np.nan, np.nan]])
    message = conversions.manipulation_to_message(
        Manipulation(points, np.array([0.0, 0.3]), asked), HEADER
    )
    message.grasp_directions[0].x *= 5
    message.grasp_directions[0].y *= 5
    again = conversions.manipulation_from_message(message).grasp_directions_in_table
    assert again is not None and np.allclose(again, asked, equal_nan=True)
    free = conversions.manipulation_to_message(Manipulation(points, np.ones(2)), HEADER)
    assert conversions.manipulation_from_message(free).grasp_directions_in_table is None


@pytest.mark.parametrize("unused", [False, True])
def test_ways_of_their_own_there_and_back_again(unused: bool) -> None:
    """Each hand keeps its displacement; where one is wanted for both, it is refused."""
    points, ways = np.array([[0.1, -0.2], [0.2, 0.3]]), np.array([[0.0, 0.3], [-0.1, 0.2]])
    if unused:
        points[1], ways[1] = np.nan, np.nan
    message = conversions.manipulation_to_message(IndependentManipulation(points, ways), HEADER)
    again = conversions.hands_manipulation_from_message(message)
    assert isinstance(again, IndependentManipulation)
    assert np.array_equal(again.grasp_points_in_table, points, equal_nan=True)
    assert np.array_equal(again.displacements_in_table, ways, equal_nan=True)
    with pytest.raises(InvalidInputError, match="leave `displacements` empty"):
        conversions.manipulation_from_message(message)


@pytest.mark.parametrize(
    "message",
    [
        ManipulationMsg(used=[True, True], displacements=[Vector3(x=0.1)]),
        ManipulationMsg(used=[True, False], displacements=[Vector3(x=float("nan")), Vector3()]),
        ManipulationMsg(grasp_points=[Point(x=float("nan")), Point()], used=[True, False]),
        ManipulationMsg(used=[False, False]),
        ManipulationMsg(used=[True, True], displacement=Vector3(x=float("inf"))),
        ManipulationMsg(header=Header(frame_id="map"), used=[True, True]),
        ManipulationMsg(used=[True, True], grasp_directions=[Vector3(x=float("nan")), Vector3()]),
    ],
)
def test_manipulations_without_meaning_are_refused(message) -> None:
    """NaN, nothing used, or a foreign frame is refused."""
    with pytest.raises(InvalidInputError):
        conversions.manipulation_from_message(message)


@pytest.mark.parametrize(
    ("encoding", "dtype", "channels"),
    [("rgb8", np.uint8, 3), ("mono8", np.uint8, 1), ("16UC1", np.uint16, 1), ("32FC1", "f4", 1)],
)
def test_images_there_and_back_again(encoding, dtype, channels) -> None:
    """Every pixel survives, and padded rows are understood."""
    shape = (5, 7, channels) if channels > 1 else (5, 7)
    image = np.random.default_rng(0).integers(0, 200, shape).astype(dtype)
    message = conversions.image_to_message(image, encoding, HEADER)
    assert (conversions.image_from_message(message) == image).all()
    row = message.step
    rows = bytes(message.data)
    message.data = b"".join(rows[i * row : (i + 1) * row] + b"\0\0\0\0" for i in range(5))
    message.step = row + 4
    assert (conversions.image_from_message(message) == image).all()


def test_bgr_becomes_rgb() -> None:
    """A blue pixel is blue whatever the order of the channels."""
    message = conversions.image_to_message(
        np.array([[[255, 0, 0]]], dtype=np.uint8), "bgr8", HEADER
    )
    assert conversions.rgb_from_message(message).tolist() == [[[0, 0, 255]]]


def test_an_image_that_claims_more_than_it_carries_is_refused() -> None:
    """A cut-off image is an error that says so, not an exception of NumPy."""
    message = conversions.image_to_message(np.zeros((480, 640, 3), np.uint8), "rgb8", HEADER)
    message.data = message.data[:30]
    with pytest.raises(InvalidInputError, match="carries 30"):
        conversions.image_from_message(message)


def test_camera_there_and_back_again() -> None:
    """Intrinsics survive; an uncalibrated camera is refused."""
    camera = PinholeCamera(320, 240, 262.5, 260.0, 159.5, 119.0)
    message = conversions.camera_to_message(camera, HEADER)
    assert conversions.camera_from_message(message) == camera
    message.k = [0.0] * 9
    with pytest.raises(InvalidInputError, match="calibrat"):
        conversions.camera_from_message(message)


def test_points_and_poses_there_and_back_again() -> None:
    """Clouds survive in single precision, poses in double."""
    points = np.random.default_rng(0).normal(size=(11, 3))
    message = conversions.points_to_message(points, HEADER)
    assert np.allclose(conversions.points_from_message(message), points, atol=1e-6)
    transform = transform_from_pose([1, 2, 3], [0.5, 0.5, -0.5, 0.5])
    pose = conversions.pose_to_message(transform)
    assert np.allclose(conversions.transform_from_pose_message(pose), transform)


def test_times_there_and_back_again() -> None:
    """Seconds survive to the nanosecond."""
    for seconds in (0.0, 1.999999999, 12.25):
        message = conversions.time_to_message(seconds)
        assert conversions.time_from_message(message) == pytest.approx(seconds, abs=1e-9)


def test_error_codes_equal_the_message_constants() -> None:
    """The core's numbers and the interface's numbers are the same, name by name."""
    constants = {name: getattr(ErrorCodeMsg, name) for name in ErrorCode.__members__}
    assert constants == {name: code.value for name, code in ErrorCode.__members__.items()}


def test_every_code_comes_back_as_its_own_error() -> None:
    """What a node reports by number, its caller raises as the same class."""
    for kind in CellError.__subclasses__():
        assert type(error_from_code(kind.code, "text")) is kind


def test_a_lens_goes_there_and_back_again() -> None:
    """Model and coefficients stay; all zero, and none at all, mean no distortion."""
    lens = LensDistortion("rational_polynomial", (0.1, -0.2, 0.0, 0.001, 0.03, 0.1, 0.0, 0.2))
    message = conversions.camera_to_message(CAMERA, HEADER, lens)
    assert conversions.lens_from_message(message) == lens
    assert conversions.camera_from_message(message) == CAMERA
    assert conversions.lens_from_message(conversions.camera_to_message(CAMERA, HEADER)).is_none
    assert conversions.lens_from_message(CameraInfo()).is_none


def test_a_lens_of_an_unknown_model_is_refused() -> None:
    """The error lists the models."""
    message = CameraInfo(distortion_model="mine", d=[0.1, 0.2])
    with pytest.raises(InvalidInputError, match="plumb_bob"):
        conversions.lens_from_message(message)


def mosaic_of(colour: np.ndarray, pattern: str) -> np.ndarray:
    """What a sensor with this pattern sees of a picture, shape (H, W)."""
    seen = np.empty(colour.shape[:2], colour.dtype)
    for place, name in enumerate(pattern):
        rows, columns = slice(place // 2, None, 2), slice(place % 2, None, 2)
        seen[rows, columns] = colour[rows, columns, "rgb".index(name)]
    return seen


@pytest.mark.parametrize("bits", [8, 16])
@pytest.mark.parametrize("pattern", ["rggb", "bggr", "gbrg", "grbg"])
def test_bayer_images_are_read_as_rgb(pattern: str, bits: int) -> None:
    """A smooth picture comes back to a level or two, each colour in its channel."""
    v, u = np.mgrid[:60, :80].astype(float)
    smooth = np.stack([40 + 2 * u, 200 - u - v, 30 + 3 * v], axis=-1)
    scale, kind = (1, np.uint8) if bits == 8 else (257, np.uint16)
    mosaic = mosaic_of((smooth * scale).astype(kind), pattern)
    message = conversions.image_to_message(mosaic, f"bayer_{pattern}{bits}", HEADER)
    found = conversions.rgb_from_message(message)
    assert found.dtype == np.uint8
    assert found.shape == (60, 80, 3)
    inner = (slice(1, -1), slice(1, -1))
    np.testing.assert_allclose(found[inner].astype(float), smooth[inner], atol=1.0)


def test_bayer_images_of_either_byte_order_are_read() -> None:
    """16 bits a pixel, highest byte first."""
    mosaic = np.full((6, 8), 0x8110, np.uint16)
    message = conversions.image_to_message(mosaic, "bayer_rggb16", HEADER)
    message.data, message.is_bigendian = mosaic.astype(">u2").tobytes(), 1
    assert np.unique(conversions.rgb_from_message(message)).tolist() == [0x81]


def test_a_bayer_image_too_small_to_interpolate_is_refused() -> None:
    """Two rows do not surround any pixel."""
    message = conversions.image_to_message(np.zeros((2, 8), np.uint8), "bayer_grbg8", HEADER)
    with pytest.raises(InvalidInputError, match="8 x 2"):
        conversions.rgb_from_message(message)
