"""Where a ChArUco board lies in the camera's view (OpenCV)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np

from emd_core.errors import InvalidInputError
from emd_core.frames import FloatArray
from emd_core.pinhole_camera import PinholeCamera
from emd_perception.calibration.board import BoardConfig
from emd_perception.image_types import ColourImage
from emd_perception.lens import camera_matrix

MIN_CORNERS = 6


@dataclass(frozen=True)
class BoardView:
    """The board's inner corners that one picture shows.

    Attributes:
        on_board: Shape (N, 3), metres, the board's frame.
        pixels: Shape (N, 2), column and row.
    """

    on_board: FloatArray
    pixels: FloatArray


@dataclass(frozen=True)
class BoardPose:
    """Where the board is.

    Attributes:
        transform_board_to_camera: Shape (4, 4), metres.
        reprojection_error: Root mean square of the corners' distance from where this pose has
            them, pixels.
        corners: How many corners of all pictures it rests on.
    """

    transform_board_to_camera: FloatArray
    reprojection_error: float
    corners: int


def find_board(colour: ColourImage, board: BoardConfig) -> BoardView:
    """Find the board's corners in a picture without distortion, shape (H, W, 3), RGB.

    Raises:
        InvalidInputError: If fewer than 6 corners are seen; says how many markers were.
    """
    grey = cv2.cvtColor(colour, cv2.COLOR_RGB2GRAY)
    made = board.make()
    corners, ids, _, markers = cv2.aruco.CharucoDetector(made).detectBoard(grey)
    count = 0 if ids is None else len(ids)
    if count < MIN_CORNERS:
        raise InvalidInputError(
            f"at least {MIN_CORNERS} inner corners of the board of {board.squares_x} x "
            f"{board.squares_y} squares are needed, got {count} (and "
            f"{0 if markers is None else len(markers)} markers); is it in full view, sharp, "
            "evenly lit and the board that the options describe?"
        )
    on_board = np.asarray(made.getChessboardCorners(), dtype=np.float64)[np.ravel(ids)]
    return BoardView(on_board, np.asarray(corners, dtype=np.float64).reshape(-1, 2))


def locate_board(views: Sequence[BoardView], camera: PinholeCamera) -> BoardPose:
    """Find the pose that fits all pictures of a board at rest: IPPE, then Levenberg-Marquardt.

    Args:
        views: What the pictures show, at least one.
        camera: Of all pictures.

    Raises:
        InvalidInputError: If no pose fits the corners.
    """
    on_board = np.concatenate([view.on_board for view in views])
    pixels = np.concatenate([view.pixels for view in views])
    matrix, straight = camera_matrix(camera), np.zeros(5)
    solved, turn, position = cv2.solvePnP(
        on_board, pixels, matrix, straight, flags=cv2.SOLVEPNP_IPPE
    )
    if not solved:
        raise InvalidInputError(
            f"no pose of the board fits the {len(pixels)} corners; is the camera_info right?"
        )
    turn, position = cv2.solvePnPRefineLM(on_board, pixels, matrix, straight, turn, position)
    again, _ = cv2.projectPoints(on_board, turn, position, matrix, straight)
    squared = ((np.asarray(again).reshape(-1, 2) - pixels) ** 2).sum(axis=1)
    transform = np.eye(4)
    transform[:3, :3] = cv2.Rodrigues(turn)[0]
    transform[:3, 3] = np.ravel(position)
    return BoardPose(transform, float(np.sqrt(squared.mean())), len(pixels))
