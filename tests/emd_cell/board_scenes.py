"""A printed board on the cell's table, seen by the camera on HIRO's head."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from emd_arm_executor.hiro.camera_noise import KinectNoise
from emd_arm_executor.hiro.cell_geometry import transform_camera_to_table
from emd_arm_executor.hiro.description import OBSERVE
from emd_core.frames import FloatArray, inverse_transform
from emd_core.lens_distortion import LensDistortion
from emd_core.pinhole_camera import PinholeCamera
from emd_perception.calibration.board import BoardConfig, draw_board
from emd_perception.calibration.calibrate import BoardPlace
from emd_perception.lens import pixel_directions

_SAMPLES = 3  # rays a side of each pixel
_TABLE = 150  # grey value
_PIXELS_PER_MM = 2  # of the board's picture


@dataclass(frozen=True)
class BoardScene:
    """Frames as the camera gives them, and where it truly is."""

    colours: list[NDArray[np.uint8]]
    depths: list[NDArray[np.float32]]
    camera: PinholeCamera
    lens: LensDistortion
    transform_camera_to_table: FloatArray


def observing_camera() -> FloatArray:
    """Where the camera is while HIRO observes the table, shape (4, 4)."""
    return transform_camera_to_table(*OBSERVE.groups["head"])


def render_board(
    board: BoardConfig,
    place: BoardPlace,
    *,
    lens: LensDistortion | None = None,
    frames: int = 5,
    seed: int = 0,
    pose: FloatArray | None = None,
) -> BoardScene:
    """Trace the rays of a distorting camera to the table, with a Kinect's noise on top."""
    camera, lens = PinholeCamera(), lens or LensDistortion()
    pose = observing_camera() if pose is None else pose
    directions = pixel_directions(camera, lens).astype(np.float32)
    size = (camera.width * _SAMPLES, camera.height * _SAMPLES)
    fine = cv2.resize(directions, size, interpolation=cv2.INTER_LINEAR)
    print_ = _seen_print(fine, board, place, pose)
    grey = cv2.resize(print_, (camera.width, camera.height), interpolation=cv2.INTER_AREA)
    picture = np.repeat(np.rint(grey).astype(np.uint8)[..., None], 3, axis=2)
    slope = directions @ pose[2, :2] + pose[2, 2]
    depth = (-pose[2, 3] / slope).astype(np.float32)
    noise = KinectNoise(np.random.default_rng(seed))
    return BoardScene(
        [noise.colour(picture) for _ in range(frames)],
        [noise.depth(depth, camera) for _ in range(frames)],
        camera,
        lens,
        pose,
    )


def _seen_print(
    directions: NDArray[np.float32], board: BoardConfig, place: BoardPlace, pose: FloatArray
) -> NDArray[np.float32]:
    """Grey values of the board, or of the table around it, where rays meet the table."""
    rays = np.concatenate([directions, np.ones((*directions.shape[:2], 1), np.float32)], axis=2)
    rays = rays @ pose[:3, :3].T.astype(np.float32)
    reach = -pose[2, 3] / rays[..., 2]
    on_table = pose[:3, 3] + reach[..., None] * rays
    to_board = inverse_transform(board.transform_to_table(place.x, place.y, place.yaw))
    on_board = 1e3 * (on_table @ to_board[:3, :3].T + to_board[:3, 3])  # millimetres
    reduced = cv2.resize(
        draw_board(board), None, fx=0.1 * _PIXELS_PER_MM, fy=0.1 * _PIXELS_PER_MM,
        interpolation=cv2.INTER_AREA,
    )  # fmt: skip
    margin = 10 * _PIXELS_PER_MM  # of white paper
    sheet = cv2.copyMakeBorder(reduced, *[margin] * 4, cv2.BORDER_CONSTANT, value=255)
    where = on_board[..., :2] * _PIXELS_PER_MM + margin - 0.5
    return cv2.remap(
        (0.1 + 0.8 * sheet / 255.0).astype(np.float32) * 255.0,
        where[..., 0].astype(np.float32), where[..., 1].astype(np.float32),
        cv2.INTER_LINEAR, borderMode=cv2.BORDER_CONSTANT, borderValue=_TABLE,
    )  # fmt: skip
