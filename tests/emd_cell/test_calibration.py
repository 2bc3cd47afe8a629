"""The camera's pose from a printed board and the table's plane."""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from board_scenes import BoardScene, render_board
from PIL import Image
from scipy.spatial.transform import Rotation

from emd_core.errors import InvalidInputError
from emd_core.frames import inverse_transform
from emd_core.lens_distortion import LensDistortion
from emd_core.pinhole_camera import PinholeCamera
from emd_perception.calibration.board import BoardConfig, write_board
from emd_perception.calibration.calibrate import BoardPlace, calibrate
from emd_perception.calibration.calibration import FORMAT, Calibration
from emd_perception.calibration.check import check_calibration
from emd_perception.frame_input import CalibratedCamera, FrameAligner, InputConfig
from emd_perception.table_plane import TablePlane

LENS = LensDistortion("plumb_bob", (0.1, -0.2, 0.001, -0.001, 0.05))
BOARD, ASIDE = BoardConfig(), BoardPlace(0.03, -0.05, 0.3)


@pytest.fixture(scope="module")
def upright() -> BoardScene:
    """The board in the middle, no distortion."""
    return render_board(BOARD, BoardPlace(), frames=3)


@pytest.fixture(scope="module")
def bent() -> BoardScene:
    """The board aside and turned, through a lens that bends 8 pixels."""
    return render_board(BOARD, ASIDE, lens=LENS, frames=3, seed=1)


def calibrated(scene: BoardScene, place: BoardPlace, board: BoardConfig = BOARD) -> Calibration:
    """Calibrate as the command does: straighten, then look for the board."""
    aligner = FrameAligner(InputConfig(), CalibratedCamera(scene.camera, scene.lens))
    return calibrate(
        [aligner.colour(colour) for colour in scene.colours],
        [aligner.depth(depth) for depth in scene.depths],
        aligner.camera,
        board,
        place,
    )


def errors(found: Calibration, scene: BoardScene) -> tuple[float, float]:
    """Largest error of a point within 0.2 m on the table (mm), and of the turn (degrees)."""
    error = found.transform_camera_to_table @ inverse_transform(scene.transform_camera_to_table)
    corners = np.array([[x, y, 0.0, 1.0] for x in (-0.2, 0.2) for y in (-0.2, 0.2)])
    moved = (corners @ error.T - corners)[:, :3]
    turn = Rotation.from_matrix(error[:3, :3]).magnitude()
    return float(1e3 * np.linalg.norm(moved, axis=1).max()), float(np.degrees(turn))


@pytest.mark.parametrize(("scene", "place"), [("upright", BoardPlace()), ("bent", ASIDE)])
def test_the_pose_is_found_through_noise_and_lens(request, scene, place) -> None:
    """To half a millimetre on the table and 0.1 degrees; corners to a fifth of a pixel."""
    rendered = request.getfixturevalue(scene)
    found = calibrated(rendered, place)
    millimetres, degrees = errors(found, rendered)
    assert millimetres < 0.5
    assert degrees < 0.1
    assert found.reprojection_error < 0.2
    assert found.corners == 3 * 12


def test_a_lens_that_is_ignored_is_noticed(bent) -> None:
    """The same pictures taken for straight ones give a worse fit and a wrong pose."""
    blind = calibrated(replace(bent, lens=LensDistortion()), ASIDE)
    true = calibrated(bent, ASIDE)
    assert blind.reprojection_error > 1.4 * true.reprojection_error
    assert errors(blind, bent)[0] > 3.0 * errors(true, bent)[0]


def test_a_board_of_another_size_is_refused(upright) -> None:
    """Squares of 44 mm taken for 48: the table's depth contradicts the board."""
    with pytest.raises(InvalidInputError, match="squares measure"):
        calibrated(upright, BoardPlace(), replace(BOARD, square_length=0.044, marker_length=0.033))


def test_pictures_without_a_board_are_refused(upright) -> None:
    """The error says how many corners were wanted and came; one picture with it is enough."""
    empty = [np.full_like(colour, 120) for colour in upright.colours]
    with pytest.raises(InvalidInputError, match="at least 6 inner corners.*got 0"):
        calibrated(replace(upright, colours=empty), BoardPlace())
    found = calibrated(replace(upright, colours=[*empty[:2], upright.colours[0]]), BoardPlace())
    assert found.corners == 12


def test_a_board_that_moved_is_refused(upright) -> None:
    """Pictures that no single pose fits."""
    moved = [np.roll(upright.colours[0], 6, axis=1), *upright.colours[1:]]
    with pytest.raises(InvalidInputError, match="at rest"):
        calibrated(replace(upright, colours=moved), BoardPlace())


def test_the_file_gives_back_what_was_stored(upright, tmp_path) -> None:
    """Pose to the last digits, plane, error and counts."""
    stored = calibrated(upright, BoardPlace())
    stored.save(tmp_path / "folder" / "camera.yaml")
    loaded = Calibration.load(tmp_path / "folder" / "camera.yaml")
    np.testing.assert_allclose(
        loaded.transform_camera_to_table, stored.transform_camera_to_table, atol=1e-12
    )
    np.testing.assert_array_equal(loaded.table_plane, stored.table_plane)
    assert loaded.camera == stored.camera
    assert (loaded.made, loaded.corners) == (stored.made, stored.corners)
    assert [item.name for item in (tmp_path / "folder").iterdir()] == ["camera.yaml"]


@pytest.mark.parametrize(
    "text",
    ["", "a: [", "- 1", "format: other", f"format: {FORMAT}", f"format: {FORMAT}\ncamera: 3\n"],
)
def test_what_is_no_calibration_is_refused(tmp_path, text) -> None:
    """The error names the file and the command that makes a right one."""
    file = tmp_path / "camera.yaml"
    file.write_text(text)
    with pytest.raises(InvalidInputError, match="camera.yaml.*calibra"):
        Calibration.load(file)
    with pytest.raises(InvalidInputError, match="cannot read"):
        Calibration.load(tmp_path / "missing.yaml")


def lifted(plane: np.ndarray, height: float, turn: float) -> TablePlane:
    """The plane, higher by so many metres and turned by so many radians about the camera's x."""
    rotation = Rotation.from_euler("x", turn).as_matrix()
    return TablePlane(np.append(rotation @ plane[:3], plane[3] - height), 1.0)


def test_the_check_tells_whether_the_table_is_where_it_was(upright) -> None:
    """The same table passes; 12 mm, 2 degrees or another camera do not."""
    stored = calibrated(upright, BoardPlace())
    camera, plane = upright.camera, stored.table_plane
    assert not check_calibration(stored, camera, lifted(plane, 0.001, 0.002)).complaints
    for seen in (lifted(plane, 0.012, 0.0), lifted(plane, 0.0, np.radians(2.0))):
        (complaint,) = check_calibration(stored, camera, seen).complaints
        assert "cell calibrate" in complaint
    assert check_calibration(stored, camera, lifted(plane, 0.012, 0.0)).offset == (
        pytest.approx(0.012, abs=1e-4)
    )
    same = lifted(plane, 0.0, 0.0)
    other = PinholeCamera(fx=570.0, fy=570.0)
    assert "same camera" in check_calibration(stored, other, same).complaints[0]
    small = PinholeCamera(320, 240, 262.0, 262.0, 159.5, 119.5)
    assert "320 x 240" in check_calibration(stored, small, same).complaints[0]


def test_the_printed_board_has_its_true_size(tmp_path) -> None:
    """A4 in PDF's points and in the PNG's pixels and resolution; squares of 48 mm."""
    write_board(tmp_path / "board.pdf", BOARD)
    box = re.search(rb"/MediaBox \[ ?0 0 ([\d.]+) ([\d.]+)", (tmp_path / "board.pdf").read_bytes())
    assert box is not None
    millimetres = [float(value) / 72.0 * 25.4 for value in box.groups()]
    assert millimetres == pytest.approx([297.0, 210.0], abs=0.1)
    write_board(tmp_path / "board.png", BOARD)
    with Image.open(tmp_path / "board.png") as page:
        per_mm = page.info["dpi"][0] / 25.4
        dark = np.flatnonzero(np.asarray(page)[round(33 * per_mm)] < 128)  # first row of squares
    assert (dark[-1] - dark[0] + 1) / per_mm == pytest.approx(5 * 48.0, abs=0.15)
    assert np.asarray(page.size) / per_mm == pytest.approx([297.0, 210.0], abs=0.1)


@pytest.mark.parametrize(
    ("arguments", "complaint"),
    [
        ({"squares_x": 2}, "3 x 3"),
        ({"squares_x": 3000}, "2000"),
        ({"marker_length": 0.05}, "smaller"),
        ({"square_length": float("nan")}, "smaller"),
        ({"thickness": -0.1}, "thickness"),
    ],
)
def test_impossible_boards_are_refused(arguments, complaint) -> None:
    """Counts and lengths are checked."""
    with pytest.raises(InvalidInputError, match=complaint):
        BoardConfig(**arguments)


def test_a_board_is_written_as_pdf_or_png_only(tmp_path) -> None:
    """Another ending is refused before anything is drawn."""
    with pytest.raises(InvalidInputError, match=".pdf or .png"):
        write_board(Path(tmp_path / "board.jpg"), BOARD)
