"""`./cell calibrate` from a bag and from a running camera."""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import rclpy
from bag_files import TOPICS, header_at, recorded, write_bag
from board_scenes import BoardScene, render_board
from own_domain import own_domain
from rclpy.qos import QoSProfile
from rich.console import Console
from sensor_msgs.msg import CameraInfo, Image

from emd_cell.calibrate_command import CalibrationRequest, describe, run_calibration
from emd_cell.ros.live_frames import live_frames
from emd_core.errors import DeadlineError, InvalidInputError
from emd_core.lens_distortion import LensDistortion
from emd_core.ros import conversions
from emd_perception.calibration.board import BoardConfig
from emd_perception.calibration.calibrate import BoardPlace
from emd_perception.calibration.calibration import Calibration
from emd_perception.frame_input import InputConfig

LENS = LensDistortion("plumb_bob", (0.1, -0.2, 0.001, -0.001, 0.05))
PLACE = BoardPlace(0.02, 0.03, -0.2)
SECOND = 1_000_000_000


@pytest.fixture(scope="module")
def scene() -> BoardScene:
    """The board through a lens, three frames."""
    return render_board(BoardConfig(), PLACE, lens=LENS, frames=3, seed=2)


def messages(scene: BoardScene, index: int, stamp: int) -> dict:
    """Calibration, colour and depth of one moment."""
    header = header_at(stamp)
    return {
        "info": conversions.camera_to_message(scene.camera, header, scene.lens),
        "color": conversions.image_to_message(scene.colours[index], "rgb8", header),
        "depth": conversions.image_to_message(scene.depths[index], "32FC1", header),
    }


def assert_is_pose_of(scene: BoardScene, found: Calibration) -> None:
    """The camera's place to a millimetre, its turn to 2 mrad."""
    np.testing.assert_allclose(
        found.transform_camera_to_table[:3, 3], scene.transform_camera_to_table[:3, 3], atol=1e-3
    )
    np.testing.assert_allclose(
        found.transform_camera_to_table, scene.transform_camera_to_table, atol=2e-3
    )


def test_a_bag_gives_the_pose_and_stores_it(scene, tmp_path) -> None:
    """Through the lens that the bag's camera_info tells of; the file holds what was found."""
    recording = [
        recorded(kind, SECOND * (index + 1), message)
        for index in range(3)
        for kind, message in messages(scene, index, SECOND * (index + 1)).items()
    ]
    bag = write_bag(tmp_path / "bag", recording)
    request = CalibrationRequest(bag, 2, TOPICS, place=PLACE)
    found = run_calibration(request, tmp_path / "camera.yaml", Console(quiet=True))
    assert found.frames == 2
    assert_is_pose_of(scene, found)
    assert_is_pose_of(scene, Calibration.load(tmp_path / "camera.yaml"))
    assert "24 corners in 2 frames" in describe(found)


def test_a_bag_without_a_usable_frame_is_refused(scene, tmp_path) -> None:
    """The reason is the first one that came; no file is written."""
    first = messages(scene, 0, SECOND)
    first["color"].encoding = "yuv422_yuy2"
    bag = write_bag(tmp_path / "bag", [recorded(*item) for item in _with_times(first)])
    request = CalibrationRequest(bag, 2, TOPICS, place=PLACE)
    with pytest.raises(InvalidInputError, match="yuv422_yuy2"):
        run_calibration(request, tmp_path / "camera.yaml", Console(quiet=True))
    assert not (tmp_path / "camera.yaml").exists()


def _with_times(one: dict) -> list[tuple]:
    return [(kind, SECOND, message) for kind, message in one.items()]


@pytest.mark.system
def test_a_running_camera_gives_the_pose(scene, tmp_path) -> None:
    """The command listens to the camera's topics until it has its frames."""
    out = tmp_path / "camera.yaml"
    with own_domain() as number:
        place = [str(PLACE.x), str(PLACE.y), str(np.degrees(PLACE.yaw))]
        command = [sys.executable, "-m", "emd_cell.cli", "calibrate", "--live", "--frames", "2"]
        process = subprocess.Popen(
            [*command, "--out", str(out), "--board-at", *place],
            stderr=subprocess.PIPE,
            text=True,
            env={**os.environ, "ROS_DOMAIN_ID": str(number)},
        )
        rclpy.init(domain_id=number)
        try:
            _publish_until_done(scene, process)
        finally:
            rclpy.try_shutdown()
            process.kill()
    assert process.returncode == 0, process.stderr.read() if process.stderr else ""
    assert_is_pose_of(scene, Calibration.load(out))


def _publish_until_done(scene: BoardScene, process: subprocess.Popen) -> None:
    node = rclpy.create_node("camera")
    best = QoSProfile(depth=5)
    publishers = {
        "info": node.create_publisher(CameraInfo, "camera/color/camera_info", best),
        "color": node.create_publisher(Image, "camera/color/image_raw", best),
        "depth": node.create_publisher(Image, "camera/depth_registered/image_raw", best),
    }
    for number in range(1, 600):
        for kind, message in messages(scene, number % 3, number * SECOND // 5).items():
            publishers[kind].publish(message)
        try:
            process.wait(timeout=0.2)
            return
        except subprocess.TimeoutExpired:
            continue


@pytest.mark.system
def test_a_silent_camera_is_told(monkeypatch) -> None:
    """What is missing, after the time allowed."""
    with own_domain() as number:
        monkeypatch.setenv("ROS_DOMAIN_ID", str(number))
        with pytest.raises(DeadlineError, match="2 frames were wanted.*no colour"):
            live_frames(2, InputConfig(), 1.5, lambda count: None)


@pytest.mark.parametrize("options", [[], ["--live", "--bag", "x"], ["--bag", "nowhere"]])
def test_wrong_options_are_one_line(tmp_path, options) -> None:
    """Neither or both sources, and a bag that is not there: status 2."""
    command = [sys.executable, "-m", "emd_cell.cli", "calibrate", *options]
    done = subprocess.run(command, capture_output=True, text=True, timeout=120, cwd=tmp_path)
    assert done.returncode == 2
    assert done.stderr.startswith("cell calibrate: ")
    assert not list(Path(tmp_path).iterdir())
