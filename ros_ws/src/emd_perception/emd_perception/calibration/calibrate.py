"""The camera's pose in the table frame: x, y and yaw from the board, the rest from the plane."""

from __future__ import annotations

import datetime
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from emd_core.errors import InvalidInputError
from emd_core.frames import inverse_transform
from emd_core.pinhole_camera import PinholeCamera
from emd_perception.calibration.board import BoardConfig
from emd_perception.calibration.board_pose import BoardView, find_board, locate_board
from emd_perception.calibration.calibration import Calibration
from emd_perception.config import FusionConfig, PlaneConfig
from emd_perception.fusion import trimmed_mean
from emd_perception.image_types import ColourImage, DepthImage
from emd_perception.table_frame import refine_table_frame
from emd_perception.table_search import find_table


@dataclass(frozen=True)
class BoardPlace:
    """Where the board's middle lies in the table frame.

    Attributes:
        x: Metres.
        y: Metres.
        yaw: Radians about z; 0: its upper edge is the picture's.
    """

    x: float = 0.0
    y: float = 0.0
    yaw: float = 0.0


def calibrate(
    colours: Sequence[ColourImage],
    depths: Sequence[DepthImage],
    camera: PinholeCamera,
    board: BoardConfig,
    place: BoardPlace,
    max_reprojection_error: float = 1.0,
) -> Calibration:
    """Find the camera's pose from pictures of a board at rest on the table.

    A board of a page's size tells its place in the picture to a tenth of a pixel, but its tilt and
    distance only to some tenths of a degree and some millimetres. The table's depth tells both
    better, and in the measure in which perception will see heights. So tilt and height are the
    plane's, and x, y and yaw the board's.

    Args:
        colours: Each of shape (H, W, 3), RGB uint8, without distortion.
        depths: As many, shape (H, W), metres, NaN where unknown, registered to colour.
        camera: Of all images.
        board: The board.
        place: Where it lies.
        max_reprojection_error: Largest root mean square error that is accepted, pixels.

    Raises:
        InvalidInputError: If the board is in none of the pictures, moved, does not lie on the
            table that the depth shows, or the table is not found.
    """
    pose = locate_board(_views(colours, board), camera)
    if pose.reprojection_error > max_reprojection_error:
        raise InvalidInputError(
            f"the board's corners should be at most {max_reprojection_error:g} pixels from where "
            f"its pose has them, got {pose.reprojection_error:.2f}; were camera and board at "
            "rest, is the board flat, is the camera_info that of these images?"
        )
    to_table = board.transform_to_table(place.x, place.y, place.yaw)
    by_board = to_table @ inverse_transform(pose.transform_board_to_camera)
    fused = trimmed_mean(np.stack(depths), FusionConfig())
    plane = find_table(fused, camera, by_board, PlaneConfig())
    refined = refine_table_frame(by_board, plane)
    if not refined.agrees:
        raise InvalidInputError(
            f"the table's depth is tilted by {np.degrees(refined.tilt):.1f} degrees against the "
            f"board and {1e3 * refined.offset:.0f} mm above it; does the board lie on the table, "
            "do its squares measure what the options say, is the depth registered?"
        )
    return Calibration(
        camera,
        refined.transform_camera_to_table,
        plane.coefficients,
        pose.reprojection_error,
        pose.corners,
        len(colours),
        refined.tilt,
        refined.offset,
        datetime.datetime.now(datetime.UTC).isoformat(timespec="seconds"),
    )


def _views(colours: Sequence[ColourImage], board: BoardConfig) -> list[BoardView]:
    """Look for the board in every picture; some may miss it, not all."""
    views: list[BoardView] = []
    complaint: InvalidInputError | None = None
    for colour in colours:
        try:
            views.append(find_board(colour, board))
        except InvalidInputError as err:
            complaint = err
    if complaint is not None and not views:
        raise complaint
    if not views:
        raise InvalidInputError("at least one picture of the board is needed, got none")
    return views
