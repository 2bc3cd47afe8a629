"""Tests of perception of image files."""

import json
from pathlib import Path

import cv2
import numpy as np
import pytest

from emd_core.errors import InvalidInputError, NoClothError
from emd_core.voxel_grid import VoxelGrid
from emd_perception.files import perceive_files, read_depth

INTRINSICS = (525.0, 525.0, 319.5, 239.5)
OUTPUTS = {"mask.png", "voxel_grid.npz", "overlay.png", "summary.json"}
KEYS = {"cloth_pixels", "occupied_voxels", "table_plane", "quality", "reason", "ms"}


def write(folder: Path, scene) -> tuple[Path, Path]:
    """Write a scene's first frame as PNG files, depth in millimetres."""
    colour, depth = folder / "colour.png", folder / "depth.png"
    cv2.imwrite(str(colour), np.ascontiguousarray(scene.colour[..., ::-1]))
    cv2.imwrite(str(depth), np.nan_to_num(scene.depth_frames[0] * 1000).astype(np.uint16))
    return colour, depth


@pytest.fixture
def images(tmp_path: Path, flat_scene) -> tuple[Path, Path]:
    """Files of the flat cloth."""
    return write(tmp_path, flat_scene)


def test_four_files_are_written(images, tmp_path, flat_scene) -> None:
    """Mask, grid, overlay and summary agree with each other and with the scene."""
    summary = perceive_files(*images, INTRINSICS, "mm", tmp_path / "new" / "out")
    out = tmp_path / "new" / "out"
    assert {file.name for file in out.iterdir()} == OUTPUTS
    mask = cv2.imread(str(out / "mask.png"), cv2.IMREAD_UNCHANGED)
    assert mask.shape == (480, 640)
    assert set(np.unique(mask)) == {0, 255}
    assert ((mask > 0) & flat_scene.mask).sum() / ((mask > 0) | flat_scene.mask).sum() > 0.95
    grid = VoxelGrid.load(out / "voxel_grid.npz")
    assert cv2.imread(str(out / "overlay.png")).shape == (480, 640, 3)
    stored = json.loads((out / "summary.json").read_text())
    assert stored == summary
    assert set(stored) >= KEYS
    assert stored["cloth_pixels"] == (mask > 0).sum()
    assert stored["occupied_voxels"] == grid.occupancy.sum()
    assert len(stored["table_plane"]) == 4
    assert 0.9 < stored["quality"] <= 1.0
    assert stored["ms"] > 0


def test_extrinsics_and_half_extent_are_used(images, tmp_path, flat_scene) -> None:
    """A chosen half extent is kept; with extrinsics the cloth lies where it is."""
    summary = perceive_files(
        *images, INTRINSICS, "mm", tmp_path / "out", 0.5, flat_scene.transform_camera_to_table
    )
    assert summary["half_extent"] == 0.5
    assert summary["notes"] == []
    assert VoxelGrid.load(tmp_path / "out" / "voxel_grid.npz").field_of_view.half_extent == 0.5


@pytest.mark.parametrize("kind", [".tiff", ".npy"])
def test_float_depth_gives_the_same_as_millimetres(kind, images, tmp_path) -> None:
    """Metres as floats, from TIFF or numpy, are the same depth."""
    millimetres = read_depth(images[1], "mm")
    path = tmp_path / f"depth{kind}"
    metres = np.nan_to_num(millimetres)
    np.save(path, metres) if kind == ".npy" else cv2.imwrite(str(path), metres)
    np.testing.assert_allclose(read_depth(path, "m"), millimetres, rtol=1e-6)
    np.testing.assert_allclose(read_depth(path, "mm"), millimetres / 1000, rtol=1e-6)


def test_results_in_the_folder_are_replaced(images, tmp_path) -> None:
    """A second run replaces the four files and leaves others alone."""
    out = tmp_path / "out"
    out.mkdir()
    (out / "mask.png").write_text("old")
    (out / "notes.txt").write_text("mine")
    perceive_files(*images, INTRINSICS, "mm", out)
    assert {file.name for file in out.iterdir()} == OUTPUTS | {"notes.txt"}
    assert (out / "mask.png").read_bytes()[:4] == b"\x89PNG"


def test_nothing_is_written_when_no_cloth_is_seen(tmp_path, empty_scene) -> None:
    """After an error no file of a result exists."""
    images = write(tmp_path, empty_scene)
    with pytest.raises(NoClothError):
        perceive_files(*images, INTRINSICS, "mm", tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_nothing_is_left_when_writing_fails(images, tmp_path, monkeypatch) -> None:
    """If one file cannot be written, none of the four appears."""

    def fail(self: VoxelGrid, path: Path) -> None:
        raise OSError("disk full")

    monkeypatch.setattr(VoxelGrid, "save", fail)
    with pytest.raises(OSError, match="disk full"):
        perceive_files(*images, INTRINSICS, "mm", tmp_path / "out")
    assert list((tmp_path / "out").iterdir()) == []


@pytest.mark.parametrize(
    ("change", "complaint"),
    [
        ({"color": "missing.png"}, "cannot read"),
        ({"depth": "missing.png"}, "cannot read"),
        ({"color": "broken.png"}, "no image"),
        ({"depth": "empty.png"}, "no image"),
        ({"color": "grey.png"}, "three channels"),
        ({"color": "transparent.png"}, "three channels"),
        ({"color": "depth.png"}, "three channels"),
        ({"depth": "grey.png"}, "16-bit"),
        ({"depth": "colour.png"}, "16-bit"),
        ({"depth": "small.png"}, "same size"),
        ({"depth": "nothing.png"}, "no valid"),
        ({"depth_scale": "cm"}, "unit"),
        ({"depth_scale": "m"}, "mm"),
        ({"intrinsics": (0.0, 525.0, 319.5, 239.5)}, "focal lengths"),
        ({"intrinsics": (float("nan"), 525.0, 319.5, 239.5)}, "finite"),
        ({"intrinsics": (319.5, 239.5, 5250.0, 525.0)}, "principal point"),
        ({"intrinsics": (525.0, 525.0)}, "four numbers"),
        ({"half_extent": -1.0}, "half_extent"),
        ({"out": "colour.png"}, "folder"),
    ],
)
def test_bad_input_is_refused_and_nothing_written(change, complaint, images, tmp_path) -> None:
    """Each wrong file or value is named, and no result appears."""
    (tmp_path / "broken.png").write_bytes(images[0].read_bytes()[:40])
    (tmp_path / "empty.png").write_bytes(b"")
    cv2.imwrite(str(tmp_path / "grey.png"), np.full((480, 640), 90, np.uint8))
    cv2.imwrite(str(tmp_path / "transparent.png"), np.full((480, 640, 4), 90, np.uint8))
    cv2.imwrite(str(tmp_path / "small.png"), np.full((240, 320), 900, np.uint16))
    cv2.imwrite(str(tmp_path / "nothing.png"), np.zeros((480, 640), np.uint16))
    arguments = {
        "color": images[0],
        "depth": images[1],
        "intrinsics": INTRINSICS,
        "depth_scale": "mm",
        "out": tmp_path / "out",
    }
    paths = ("color", "depth", "out")
    arguments |= {
        key: tmp_path / value if key in paths else value for key, value in change.items()
    }
    with pytest.raises(InvalidInputError, match=complaint):
        perceive_files(**arguments)
    assert not (tmp_path / "out").exists()
