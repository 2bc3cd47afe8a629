"""All conversions between ROS messages and the types of the cores."""

from __future__ import annotations

import array
import sys
from typing import Any

import numpy as np
from builtin_interfaces.msg import Duration as DurationMsg
from builtin_interfaces.msg import Time as TimeMsg
from geometry_msgs.msg import Point, Pose, Quaternion, Vector3
from numpy.typing import NDArray
from sensor_msgs.msg import CameraInfo, Image
from std_msgs.msg import Header
from trajectory_msgs.msg import JointTrajectory as JointTrajectoryMsg
from trajectory_msgs.msg import JointTrajectoryPoint

from emd_core.errors import InvalidInputError
from emd_core.frames import FieldOfView, FloatArray, pose_from_transform, transform_from_pose
from emd_core.independent_manipulation import HandsManipulation, IndependentManipulation
from emd_core.lens_distortion import LensDistortion
from emd_core.manipulation import Manipulation
from emd_core.pinhole_camera import PinholeCamera
from emd_core.ros.point_clouds import points_from_message as points_from_message
from emd_core.ros.point_clouds import points_to_message as points_to_message
from emd_core.voxel_grid import VoxelGrid
from emd_msgs_py.msg import Manipulation as ManipulationMsg
from emd_msgs_py.msg import VoxelGrid as VoxelGridMsg

TABLE_FRAME = "table"
CAMERA_FRAME = "camera_optical_frame"

_ENCODINGS: dict[str, tuple[str, int]] = {
    "rgb8": ("u1", 3),
    "bgr8": ("u1", 3),
    "rgba8": ("u1", 4),
    "bgra8": ("u1", 4),
    "mono8": ("u1", 1),
    "8UC1": ("u1", 1),
    "8UC3": ("u1", 3),
    "mono16": ("u2", 1),
    "16UC1": ("u2", 1),
    "32FC1": ("f4", 1),
    **{
        f"bayer_{pattern}{bits}": (f"u{bits // 8}", 1)
        for pattern in ("rggb", "bggr", "gbrg", "grbg")
        for bits in (8, 16)
    },
}


def byte_array(values: NDArray[Any]) -> array.array[int]:
    """Pack an array's bytes as rclpy takes them fastest (a numpy array takes 60 times as long)."""
    return array.array("B", np.ascontiguousarray(values).tobytes())


def time_to_message(seconds: float) -> TimeMsg:
    """Convert seconds to a time message."""
    whole, fraction = divmod(round(seconds * 1e9), 1_000_000_000)
    return TimeMsg(sec=int(whole), nanosec=int(fraction))


def time_from_message(message: TimeMsg | DurationMsg) -> float:
    """Convert a time or duration message to seconds."""
    return float(message.sec) + float(message.nanosec) * 1e-9


def duration_to_message(seconds: float) -> DurationMsg:
    """Convert seconds to a duration message."""
    whole, fraction = divmod(round(seconds * 1e9), 1_000_000_000)
    return DurationMsg(sec=int(whole), nanosec=int(fraction))


def header(stamp: TimeMsg | float, frame_id: str) -> Header:
    """Make a header; a float stamp is seconds."""
    time = time_to_message(stamp) if isinstance(stamp, float) else stamp
    return Header(stamp=time, frame_id=frame_id)


def voxel_grid_to_message(grid: VoxelGrid, message_header: Header) -> VoxelGridMsg:
    """Pack a voxel grid."""
    fov = grid.field_of_view
    unknown = np.zeros(0, dtype=np.uint8)
    if grid.unknown is not None and grid.unknown.any():
        unknown = np.packbits(grid.unknown)
    return VoxelGridMsg(
        header=message_header,
        size_x=fov.size[0],
        size_y=fov.size[1],
        size_z=fov.size[2],
        resolution=Vector3(**dict(zip("xyz", fov.resolution.tolist(), strict=True))),
        origin=Point(**dict(zip("xyz", fov.origin.tolist(), strict=True))),
        half_extent=fov.half_extent,
        z_scale=fov.z_scale,
        encoding=VoxelGridMsg.PACKED,
        data=byte_array(np.packbits(grid.occupancy)),
        unknown=byte_array(unknown),
    )


def voxel_grid_from_message(message: VoxelGridMsg) -> VoxelGrid:
    """Unpack a voxel grid.

    Raises:
        InvalidInputError: If sizes, scales, encoding and data do not fit together.
    """
    size = (message.size_x, message.size_y, message.size_z)
    count = int(np.prod(size))
    if count == 0 or count > 1 << 24:
        raise InvalidInputError(f"a voxel grid needs sizes such as 32 x 32 x 16, got {size}")
    if not np.isfinite(message.z_scale) or message.z_scale <= 0:
        raise InvalidInputError(
            f"z_scale must be positive (4 in the paper), got {message.z_scale}"
        )
    fov = FieldOfView(message.half_extent, 1.0 / message.z_scale, size)
    data = np.frombuffer(bytes(message.data), dtype=np.uint8)
    packed = message.encoding == VoxelGridMsg.PACKED
    if not packed and message.encoding != VoxelGridMsg.PLAIN:
        raise InvalidInputError(f"encoding must be PLAIN or PACKED, got {message.encoding}")
    wanted = (count + 7) // 8 if packed else count
    if data.size != wanted:
        raise InvalidInputError(
            f"{size} voxels, {'packed' if packed else 'plain'}, need {wanted} bytes of data, "
            f"got {data.size}"
        )
    values = np.unpackbits(data, count=count) if packed else data
    if values.max() > 1:
        raise InvalidInputError(f"plain voxels must be 0 or 1, got {values.max()}")
    return VoxelGrid(values.reshape(size).astype(bool), fov, _unknown_columns(message, size))


def _unknown_columns(
    message: VoxelGridMsg, size: tuple[int, int, int]
) -> NDArray[np.bool_] | None:
    data = np.frombuffer(bytes(message.unknown), dtype=np.uint8)
    if data.size == 0:
        return None
    count = size[0] * size[1]
    if data.size != (count + 7) // 8:
        raise InvalidInputError(
            f"unknown columns of {size[0]} x {size[1]} need {(count + 7) // 8} bytes, got "
            f"{data.size}; leave them out if all are known"
        )
    return np.unpackbits(data, count=count).reshape(size[:2]).astype(bool)


def manipulation_to_message(
    manipulation: HandsManipulation, message_header: Header
) -> ManipulationMsg:
    """Convert a manipulation; unused points become 0 with `used` false, free directions 0."""
    points = np.nan_to_num(manipulation.grasp_points_in_table)
    asked = manipulation.grasp_directions_in_table
    directions = np.zeros((2, 2)) if asked is None else np.nan_to_num(asked)
    message = ManipulationMsg(
        header=message_header,
        grasp_points=[Point(x=float(x), y=float(y)) for x, y in points],
        used=list(manipulation.used),
        grasp_directions=[Vector3(x=float(x), y=float(y)) for x, y in directions],
    )
    displacements = np.nan_to_num(manipulation.displacements_in_table).tolist()
    if isinstance(manipulation, IndependentManipulation):
        message.displacements = [Vector3(x=dx, y=dy) for dx, dy in displacements]
    else:
        dx, dy = displacements[0]
        message.displacement = Vector3(x=dx, y=dy)
    return message


def manipulation_from_message(message: ManipulationMsg) -> Manipulation:
    """Read a manipulation in which both hands share one displacement.

    Raises:
        InvalidInputError: If it is not in the table frame, nothing is used, a value is NaN, or
            each hand has a displacement of its own.
    """
    manipulation = hands_manipulation_from_message(message)
    if isinstance(manipulation, IndependentManipulation):
        raise InvalidInputError(
            "one displacement for both hands is wanted here, got one for each; leave "
            "`displacements` empty"
        )
    return manipulation


def hands_manipulation_from_message(message: ManipulationMsg) -> HandsManipulation:
    """Read a manipulation in which hands may have displacements of their own.

    A grasp direction may have any length; it is given back as a unit vector.

    Raises:
        InvalidInputError: If it is not in the table frame, nothing is used, a value is NaN, or
            there is a displacement for one of the two points only.
    """
    if message.header.frame_id not in ("", TABLE_FRAME):
        raise InvalidInputError(
            f"a manipulation must be in frame '{TABLE_FRAME}', got '{message.header.frame_id}'"
        )
    points = np.array([[point.x, point.y] for point in message.grasp_points])
    used = np.array(message.used, dtype=bool)
    if not np.isfinite(points[used]).all():
        raise InvalidInputError(
            f"the used grasp points must be finite, got {points[used].tolist()}; "
            "mark a point that is not wanted with used = false"
        )
    points[~used] = np.nan
    directions = _directions(message)
    if not message.displacements:
        displacement = np.array([message.displacement.x, message.displacement.y])
        return Manipulation(points, displacement, directions)
    displacements = np.array([[move.x, move.y] for move in message.displacements])
    if displacements.shape != points.shape or not np.isfinite(displacements[used]).all():
        raise InvalidInputError(
            "`displacements` must be empty or finite for each of the two points, got "
            f"{displacements.tolist()}"
        )
    displacements[~used] = np.nan
    return IndependentManipulation(points, displacements, directions)


def _directions(message: ManipulationMsg) -> FloatArray | None:
    """Unit vectors, NaN where a direction has no length; None where both have none."""
    values = np.array([[item.x, item.y] for item in message.grasp_directions])
    if not values.any():
        return None
    if not np.isfinite(values).all():
        raise InvalidInputError(
            f"grasp directions must be finite, got {values.tolist()}; zero lets the executor "
            "choose"
        )
    lengths = np.linalg.norm(values, axis=1, keepdims=True)
    return np.where(lengths > 0, values / np.where(lengths > 0, lengths, 1.0), np.nan)


def image_to_message(image: NDArray[Any], encoding: str, message_header: Header) -> Image:
    """Convert an array (H, W[, C]) whose type fits `encoding`."""
    kind, channels = _ENCODINGS[encoding]
    if image.dtype != np.dtype(kind) or image.size != image.shape[0] * image.shape[1] * channels:
        raise InvalidInputError(
            f"an image of encoding {encoding} needs {kind} with {channels} channels, got "
            f"{image.dtype} of shape {image.shape}"
        )
    return Image(
        header=message_header,
        height=image.shape[0],
        width=image.shape[1],
        encoding=encoding,
        is_bigendian=sys.byteorder == "big",
        step=image.shape[1] * channels * image.itemsize,
        data=byte_array(image),
    )


def image_from_message(message: Any) -> NDArray[Any]:
    """Read an image as (H, W) or (H, W, C) in the encoding's own type.

    Raises:
        InvalidInputError: If the encoding is unknown or the data are fewer than claimed.
    """
    if message.encoding not in _ENCODINGS:
        raise InvalidInputError(
            f"an image encoding out of {', '.join(_ENCODINGS)} is needed, got '{message.encoding}'"
        )
    kind, channels = _ENCODINGS[message.encoding]
    dtype = np.dtype(kind).newbyteorder(">" if message.is_bigendian else "<")
    row = message.width * channels * dtype.itemsize
    step = message.step or row
    if message.height < 1 or message.width < 1 or step < row:
        raise InvalidInputError(
            f"an image of {message.width} x {message.height} {message.encoding} needs a step of "
            f"at least {row} bytes, got {message.step}"
        )
    if len(message.data) < message.height * step:
        raise InvalidInputError(
            f"the image claims {message.width} x {message.height} {message.encoding}, "
            f"{message.height * step} bytes, but carries {len(message.data)}; it was cut off"
        )
    raw = np.frombuffer(bytearray(message.data), dtype=np.uint8)[: message.height * step]
    rows = np.ascontiguousarray(raw.reshape(message.height, step)[:, :row])
    image = rows.view(dtype).reshape(message.height, message.width, channels)
    image = image.astype(dtype.newbyteorder("="), copy=False)
    return image[..., 0] if channels == 1 else image


def rgb_from_message(message: Any) -> NDArray[np.uint8]:
    """Read a colour image as RGB, shape (H, W, 3).

    Bayer images are interpolated; of 16 bits the upper 8 remain.

    Raises:
        InvalidInputError: If it is not a colour image.
    """
    image = image_from_message(message)
    if message.encoding.startswith("bayer_"):
        from emd_core.ros.bayer import rgb_from_bayer  # only then OpenCV is needed here

        return rgb_from_bayer(image, message.encoding)
    if image.ndim != 3 or image.dtype != np.uint8:
        raise InvalidInputError(
            f"a colour image (rgb8, bgr8, rgba8, bgra8, bayer_*) is needed, got {message.encoding}"
        )
    reversed_order = message.encoding.startswith(("bgr", "8UC3"))
    # A slice is copied faster than the same channels by a list of indices.
    return np.array(image[..., 2::-1] if reversed_order else image[..., :3], order="C")


def camera_from_message(message: Any) -> PinholeCamera:
    """Read a pinhole camera from its CameraInfo.

    Raises:
        InvalidInputError: If the calibration is missing.
    """
    k = [float(value) for value in getattr(message, "k", getattr(message, "K", []))]
    if len(k) != 9 or not np.isfinite(k).all() or k[0] <= 0 or k[4] <= 0:
        raise InvalidInputError(
            f"camera_info needs a calibrated matrix k with fx, fy > 0, got {k}; calibrate first"
        )
    return PinholeCamera(int(message.width), int(message.height), k[0], k[4], k[2], k[5])


def lens_from_message(message: Any) -> LensDistortion:
    """Read the distortion of a CameraInfo; none if all its coefficients are zero.

    Raises:
        InvalidInputError: If model and coefficients do not fit together.
    """
    coefficients = tuple(
        float(value) for value in getattr(message, "d", getattr(message, "D", []))
    )
    if not any(coefficients):  # drivers of straight images leave model or coefficients out
        return LensDistortion()
    return LensDistortion(str(message.distortion_model), coefficients)


def camera_to_message(
    camera: PinholeCamera, message_header: Header, lens: LensDistortion | None = None
) -> CameraInfo:
    """Describe a camera; without distortion if no lens is given."""
    fx, fy, cx, cy = camera.fx, camera.fy, camera.cx, camera.cy
    bent = lens or LensDistortion()
    return CameraInfo(
        header=message_header,
        height=camera.height,
        width=camera.width,
        distortion_model=bent.model,
        d=list(bent.coefficients) or [0.0] * 5,
        k=[fx, 0.0, cx, 0.0, fy, cy, 0.0, 0.0, 1.0],
        r=[1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0],
        p=[fx, 0.0, cx, 0.0, 0.0, fy, cy, 0.0, 0.0, 0.0, 1.0, 0.0],
    )


def pose_to_message(transform: FloatArray) -> Pose:
    """Convert a 4 x 4 transform to a pose."""
    position, quaternion = pose_from_transform(transform)
    return Pose(
        position=Point(**dict(zip("xyz", position.tolist(), strict=True))),
        orientation=Quaternion(**dict(zip("xyzw", quaternion.tolist(), strict=True))),
    )


def transform_from_pose_message(message: Pose) -> FloatArray:
    """Convert a pose to a 4 x 4 transform.

    Raises:
        InvalidInputError: If it is not finite or the quaternion has no length.
    """
    p, q = message.position, message.orientation
    return transform_from_pose([p.x, p.y, p.z], [q.x, q.y, q.z, q.w])


def joint_trajectory_to_message(
    joint_names: list[str],
    times: FloatArray,
    positions: FloatArray,
    velocities: FloatArray | None = None,
    accelerations: FloatArray | None = None,
) -> JointTrajectoryMsg:
    """Convert a sampled trajectory: times (T,) in seconds from its start, values (T, J).

    The stamp is left at zero, which means "start when it arrives" to ros2_control.
    """
    points = []
    for index, time in enumerate(np.asarray(times, dtype=np.float64)):
        point = JointTrajectoryPoint(
            positions=positions[index].tolist(), time_from_start=duration_to_message(float(time))
        )
        if velocities is not None:
            point.velocities = velocities[index].tolist()
        if accelerations is not None:
            point.accelerations = accelerations[index].tolist()
        points.append(point)
    return JointTrajectoryMsg(joint_names=list(joint_names), points=points)
