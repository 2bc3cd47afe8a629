"""The camera's pose from a rendered board of known place, with the table's plane and without.

The board lies near the middle of the cell's table, turned by up to 30 degrees; the camera is near
its place on HIRO's head; every other one has a lens that bends the picture by some pixels; five
frames with a Kinect's noise each.
"""

import sys
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console
from rich.progress import track
from scipy.spatial.transform import Rotation

sys.path.insert(0, str(Path(__file__).parents[1] / "emd_cell"))

from board_scenes import BoardScene, observing_camera, render_board  # noqa: E402

from emd_cell.bench import BenchmarkResult  # noqa: E402
from emd_core.frames import FloatArray, inverse_transform  # noqa: E402
from emd_core.lens_distortion import LensDistortion  # noqa: E402
from emd_perception.calibration.board import BoardConfig  # noqa: E402
from emd_perception.calibration.board_pose import find_board, locate_board  # noqa: E402
from emd_perception.calibration.calibrate import BoardPlace, calibrate  # noqa: E402
from emd_perception.frame_input import (  # noqa: E402
    CalibratedCamera,
    FrameAligner,
    InputConfig,
)

SCENES = 8
FRAMES = 5
SEED = 0
REACH = 0.2  # metres from the table's origin within which errors count


@dataclass(frozen=True)
class Row:
    """One scene.

    Attributes:
        lens: Whether the camera has one.
        millimetres: Largest error of a point on the table within reach.
        degrees: Error of the camera's turn.
        board_millimetres: The same error by the board alone.
        board_degrees: The same by the board alone.
        reprojection_px: Root mean square.
    """

    lens: bool
    millimetres: float
    degrees: float
    board_millimetres: float
    board_degrees: float
    reprojection_px: float


def run() -> BenchmarkResult:
    """Calibrate in all scenes."""
    numbers = track(range(SCENES), "scenes", console=Console(stderr=True))
    rows = [_measure(np.random.default_rng([SEED, number]), number) for number in numbers]
    config = {"scenes": SCENES, "frames": FRAMES, "seed": SEED, **asdict(BoardConfig())}
    columns = ("millimetres", "degrees", "board_millimetres", "board_degrees", "reprojection_px")
    summary: dict[str, Any] = {}
    for name in columns:
        values = [getattr(row, name) for row in rows]
        summary[name] = {"median": float(np.median(values)), "largest": float(max(values))}
    return BenchmarkResult(config, [asdict(row) for row in rows], summary)


def _measure(rng: np.random.Generator, number: int) -> Row:
    board, place = BoardConfig(), BoardPlace(*rng.uniform(-0.05, 0.05, 2), rng.uniform(-0.5, 0.5))
    bent = LensDistortion("plumb_bob", (0.1, -0.2, 0.001, -0.001, 0.05))
    lens = bent if number % 2 else LensDistortion()
    scene = render_board(
        board, place, lens=lens, frames=FRAMES, seed=number, pose=_stray(rng, observing_camera())
    )
    aligner = FrameAligner(InputConfig(), CalibratedCamera(scene.camera, scene.lens))
    colours = [aligner.colour(colour) for colour in scene.colours]
    depths = [aligner.depth(depth) for depth in scene.depths]
    found = calibrate(colours, depths, aligner.camera, board, place)
    pose = locate_board([find_board(colour, board) for colour in colours], aligner.camera)
    to_table = board.transform_to_table(place.x, place.y, place.yaw)
    alone = to_table @ inverse_transform(pose.transform_board_to_camera)
    return Row(
        bool(number % 2),
        *_errors(found.transform_camera_to_table, scene),
        *_errors(alone, scene),
        found.reprojection_error,
    )


def _stray(rng: np.random.Generator, pose: FloatArray) -> FloatArray:
    strayed = pose.copy()
    strayed[:3, 3] += rng.normal(0.0, 0.02, 3)
    strayed[:3, :3] = strayed[:3, :3] @ Rotation.from_rotvec(rng.normal(0.0, 0.03, 3)).as_matrix()
    return strayed


def _errors(transform: FloatArray, scene: BoardScene) -> tuple[float, float]:
    """Where the found pose puts points of the table, and how it is turned."""
    error = transform @ inverse_transform(scene.transform_camera_to_table)
    corners = np.array([[x, y, 0.0, 1.0] for x in (-REACH, REACH) for y in (-REACH, REACH)])
    moved = (corners @ error.T - corners)[:, :3]
    turn = Rotation.from_matrix(error[:3, :3]).magnitude()
    return float(1e3 * np.linalg.norm(moved, axis=1).max()), float(np.degrees(turn))
