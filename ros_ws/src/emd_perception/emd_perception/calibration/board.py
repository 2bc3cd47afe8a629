"""The ChArUco board that is printed and laid on the table (OpenCV)."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray
from PIL import Image

from emd_core.errors import InvalidInputError
from emd_core.frames import FloatArray
from emd_core.whole_file import whole_file

_PIXELS_PER_MM = 10
_DPI = 25.4 * _PIXELS_PER_MM
_A4 = (297, 210)  # millimetres, lying
_MARGIN = 9  # millimetres that no printer prints on
_FORMATS = (".pdf", ".png")


@dataclass(frozen=True)
class BoardConfig:
    """A chessboard with ArUco markers on its white squares.

    Attributes:
        squares_x: Squares along its longer side, which lies along the table's y axis.
        squares_y: Squares along its shorter side, which lies along the table's x axis.
        square_length: Side of a square, metres.
        marker_length: Side of a marker, metres.
        thickness: Height of the printed face above the table, metres.
    """

    squares_x: int = 5
    squares_y: int = 4
    square_length: float = 0.048
    marker_length: float = 0.036
    thickness: float = 0.0

    def __post_init__(self) -> None:
        """Check the ranges.

        Raises:
            InvalidInputError: If there are too few or too many squares, a length is not positive
                and finite, or markers do not fit their squares.
        """
        if not (3 <= min(self.squares_x, self.squares_y) <= max(self.squares_x, self.squares_y)):
            raise InvalidInputError(
                f"a board needs at least 3 x 3 squares, got {self.squares_x} x {self.squares_y}"
            )
        if self.squares_x * self.squares_y > 2000:
            raise InvalidInputError(
                f"a board has at most 2000 squares, got {self.squares_x} x {self.squares_y}"
            )
        if not 0.0 < self.marker_length < self.square_length < 10.0:
            raise InvalidInputError(
                "markers must be smaller than squares, both positive lengths in metres, got "
                f"{self.marker_length} and {self.square_length}"
            )
        if not 0.0 <= self.thickness < 0.1:
            raise InvalidInputError(f"thickness must be in 0..0.1 m, got {self.thickness}")

    @property
    def size(self) -> tuple[float, float]:
        """Length along x and y of the board, metres."""
        return self.squares_x * self.square_length, self.squares_y * self.square_length

    def make(self) -> cv2.aruco.CharucoBoard:
        """Give OpenCV's board; its frame has x to the right, y down, z into the table."""
        name = (
            cv2.aruco.DICT_4X4_50
            if self.squares_x * self.squares_y <= 100
            else (cv2.aruco.DICT_4X4_1000)
        )
        return cv2.aruco.CharucoBoard(
            (self.squares_x, self.squares_y),
            self.square_length,
            self.marker_length,
            cv2.aruco.getPredefinedDictionary(name),
        )

    def transform_to_table(self, x: float = 0.0, y: float = 0.0, yaw: float = 0.0) -> FloatArray:
        """Map points of the board's frame into the table frame, shape (4, 4).

        Args:
            x: Of the board's middle in the table frame, metres.
            y: Of the board's middle in the table frame, metres.
            yaw: Turn of the board about the table's z axis, radians; 0: as the camera sees the
                upright print, its upper edge is that of the picture.
        """
        width, height = self.size
        lying = np.array(
            [
                [0.0, 1.0, 0.0, -height / 2],
                [1.0, 0.0, 0.0, -width / 2],
                [0.0, 0.0, -1.0, self.thickness],
                [0.0, 0.0, 0.0, 1.0],
            ]
        )
        turn = np.eye(4)
        turn[:2, :2] = [[np.cos(yaw), -np.sin(yaw)], [np.sin(yaw), np.cos(yaw)]]
        turn[:2, 3] = [x, y]
        return turn @ lying


def draw_board(board: BoardConfig) -> NDArray[np.uint8]:
    """Draw the board without margin, 10 pixels a millimetre, shape (H, W), grey 0..255."""
    width, height = (round(1e3 * _PIXELS_PER_MM * length) for length in board.size)
    return np.asarray(board.make().generateImage((width, height), marginSize=0), dtype=np.uint8)


def write_board(path: Path, board: BoardConfig) -> None:
    """Write a page with the board in its true size: A4 if it fits, else as large as it needs.

    Args:
        path: Ends in .pdf or .png.
        board: What to print.

    Raises:
        InvalidInputError: If the ending is another one or nothing can be written there.
    """
    if path.suffix.lower() not in _FORMATS:
        raise InvalidInputError(f"a board is written as {' or '.join(_FORMATS)}, got {path.name}")
    page = Image.fromarray(_page(board))
    with whole_file(path) as temporary:
        if path.suffix.lower() == ".pdf":
            page.save(temporary, format="PDF", resolution=_DPI)
        else:
            page.save(temporary, format="PNG", dpi=(_DPI, _DPI))


def _page(board: BoardConfig) -> NDArray[np.uint8]:
    picture = draw_board(board)
    needed = [side + 2 * _MARGIN * _PIXELS_PER_MM for side in picture.shape]
    page_size = [_A4[1] * _PIXELS_PER_MM, _A4[0] * _PIXELS_PER_MM]
    if any(side > room for side, room in zip(needed, page_size, strict=True)):
        page_size = needed
    page = np.full(page_size, 255, np.uint8)
    top, left = ((room - side) // 2 for room, side in zip(page_size, picture.shape, strict=True))
    page[top : top + picture.shape[0], left : left + picture.shape[1]] = picture
    text = (
        f"ChArUco {board.squares_x} x {board.squares_y}, squares of "
        f"{1e3 * board.square_length:g} mm: print at 100 %, then measure one. Upper edge."
    )
    cv2.putText(page, text, (left, top - 25), cv2.FONT_HERSHEY_SIMPLEX, 1.1, 90, 2, cv2.LINE_AA)
    return page
