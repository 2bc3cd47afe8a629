"""`./cell replay` and `./cell calibrate`: their options."""

from __future__ import annotations

import math
import sys
from pathlib import Path
from typing import Annotated

import typer

from emd_cell.commands.app import app, console

_COLOR, _DEPTH = "/camera/color/image_raw", "/camera/depth_registered/image_raw"
_INFO, _DEPTH_INFO = "/camera/color/camera_info", "/camera/depth/camera_info"
_POSE = "/camera/pose"
_KIND = "registered, unregistered (with --depth-info and --depth-pose) or points"
_SEVEN = "X Y Z QX QY QZ QW"
_AT_COLOUR = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0)

ColorTopic = Annotated[str, typer.Option(help="topic of the bag")]
DepthTopic = Annotated[str, typer.Option(help="topic: image, or point cloud")]
DepthKind = Annotated[str, typer.Option(help=_KIND)]
DepthPose = Annotated[
    tuple[float, float, float, float, float, float, float],
    typer.Option(metavar=_SEVEN, help="the depth's frame in the colour camera's, metres"),
]
Rectified = Annotated[
    bool, typer.Option("--rectified", help="the images are straight; ignore the lens")
]


@app.command()
def replay(
    bag: Annotated[Path, typer.Argument(help="rosbag2 directory, or a .bag of ROS 1")],
    out: Annotated[
        Path, typer.Option(help="grids, summary.json, report.md, contact_sheet.png")
    ] = Path("runs/replay"),
    rate: Annotated[
        float, typer.Option(help="recorded seconds a second; 0: as fast as possible")
    ] = 0.0,
    color: ColorTopic = _COLOR,
    depth: DepthTopic = _DEPTH,
    info: ColorTopic = _INFO,
    pose: Annotated[str, typer.Option(help="topic, may be missing")] = _POSE,
    depth_info: ColorTopic = _DEPTH_INFO,
    depth_kind: DepthKind = "registered",
    depth_pose: DepthPose = _AT_COLOUR,
    rectified: Rectified = False,
    calibration: Annotated[
        Path | None, typer.Option(help="of `calibrate`, instead of the bag's pose")
    ] = None,
) -> None:
    """Play a bag through the perception node and keep its grids."""
    from emd_cell.bag_reader import BagTopics
    from emd_cell.replay_command import run_replay
    from emd_perception.frame_input import InputConfig

    topics = BagTopics(color, depth, info, pose, depth_info)
    config = InputConfig(depth_kind, rectified, depth_pose[:3], depth_pose[3:])
    summary = run_replay(bag, topics, out, console, rate, config, calibration)
    print(summary.describe())
    for entry in summary.skipped[:5]:
        print(f"skipped at {entry['stamp']}: {entry['reason']}", file=sys.stderr)
    print(f"written: {out}")


@app.command()
def calibrate(
    bag: Annotated[Path | None, typer.Option(help="camera and board at rest")] = None,
    live: Annotated[bool, typer.Option("--live", help="from the running camera")] = False,
    out: Annotated[Path, typer.Option(help="the calibration")] = Path("calibration.yaml"),
    write_board: Annotated[
        Path | None, typer.Option(help="write the board to print (.pdf, .png), nothing else")
    ] = None,
    frames: Annotated[int, typer.Option(min=1, help="at most so many")] = 10,
    squares: Annotated[tuple[int, int], typer.Option(help="along and across")] = (5, 4),
    square_length: Annotated[float, typer.Option(help="metres, as printed")] = 0.048,
    marker_length: Annotated[float, typer.Option(help="metres, as printed")] = 0.036,
    thickness: Annotated[float, typer.Option(help="of the board, metres")] = 0.0,
    board_at: Annotated[
        tuple[float, float, float],
        typer.Option(metavar="X Y YAW", help="its middle in the table frame, metres, degrees"),
    ] = (0.0, 0.0, 0.0),
    color: ColorTopic = _COLOR,
    depth: DepthTopic = _DEPTH,
    info: ColorTopic = _INFO,
    depth_info: ColorTopic = _DEPTH_INFO,
    depth_kind: DepthKind = "registered",
    depth_pose: DepthPose = _AT_COLOUR,
    rectified: Rectified = False,
) -> None:
    """Find where the camera is from a printed board on the table; docs/camera.md."""
    from emd_cell.bag_reader import BagTopics
    from emd_cell.calibrate_command import CalibrationRequest, describe, run_calibration
    from emd_core.errors import InvalidInputError
    from emd_perception.calibration import board as boards
    from emd_perception.calibration.calibrate import BoardPlace
    from emd_perception.frame_input import InputConfig

    board = boards.BoardConfig(*squares, square_length, marker_length, thickness)
    if write_board is not None:
        boards.write_board(write_board, board)
        print(f"written: {write_board}; print at 100 %, then measure a square")
        return
    if (bag is not None) == live:
        raise InvalidInputError("give either --bag BAG or --live (or --write-board FILE)")
    request = CalibrationRequest(
        bag,
        frames,
        BagTopics(color, depth, info, depth_info=depth_info),
        InputConfig(depth_kind, rectified, depth_pose[:3], depth_pose[3:]),
        board,
        BoardPlace(board_at[0], board_at[1], math.radians(board_at[2])),
    )
    print(describe(run_calibration(request, out, console)))
    print(f"written: {out}")
