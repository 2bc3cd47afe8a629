"""Tests on recorded frames of a Kinect, with the default settings for all of them."""

from pathlib import Path

import cv2
import numpy as np
import pytest

from emd_core.errors import NoClothError
from emd_core.pinhole_camera import PinholeCamera
from emd_perception.files import read_colour, read_depth
from emd_perception.pipeline import Perception, perceive, perceive_frames

CAMERA = PinholeCamera()


def perceive_recorded(data: Path, name: str) -> Perception:
    """Perceive a recorded frame without extrinsics."""
    colour = read_colour(data / f"{name}-color.png")
    depth = read_depth(data / f"{name}-depth.png", "mm")
    return perceive(colour, depth, CAMERA)


@pytest.mark.parametrize(("name", "least_iou"), [("00023", 0.88), ("01158", 0.91)])
def test_garments_are_found_as_a_person_outlined_them(shared_data, name, least_iou) -> None:
    """Against coarse polygons, with which a perfect mask would score about 0.93."""
    found = perceive_recorded(shared_data / "clopema", name)
    path = str(shared_data / "clopema" / f"{name}-polygon.png")
    polygon = cv2.imread(path, cv2.IMREAD_UNCHANGED) > 0
    assert (found.mask & polygon).sum() / (found.mask | polygon).sum() > least_iou
    assert found.quality > 0.8
    assert found.voxel_grid.silhouette.sum() > 150


def test_wrinkles_of_a_real_shirt_are_higher_than_flat_trousers(shared_data) -> None:
    """The wrinkled shirt stands higher over the table than the flat trousers."""
    trousers, shirt = (perceive_recorded(shared_data / "clopema", n) for n in ("00023", "01158"))
    high = [np.quantile(one.points_in_table[:, 2], 0.95) for one in (trousers, shirt)]
    assert high[0] < 0.02
    assert high[0] < high[1] < 0.06


@pytest.mark.parametrize("name", ["learn0", "learn4"])
def test_boxes_on_a_table_are_no_cloth(shared_data, name) -> None:
    """Cereal boxes are refused, with a reason that tells what was seen."""
    with pytest.raises(NoClothError, match="belong to something taller"):
        perceive_recorded(shared_data / "tabletop", name)


def test_a_room_without_cloth_is_refused_or_trusted_less(shared_data) -> None:
    """A laptop and a box on a carpet: either no cloth, or little trust in what was found."""
    folder = shared_data / "rgbd_sequence"
    names = sorted(file.name.removesuffix("-color.png") for file in folder.glob("*-color.png"))
    assert len(names) == 3
    for name in names:
        try:
            found = perceive_recorded(folder, name)
        except NoClothError:
            continue
        assert found.quality < 0.9
        assert found.reason != "cloth found"


def test_several_recorded_frames_fuse(shared_data) -> None:
    """Three frames of a camera in motion do not pass as a scene at rest."""
    folder = shared_data / "rgbd_sequence"
    names = sorted(file.name.removesuffix("-color.png") for file in folder.glob("*-color.png"))
    colours = [read_colour(folder / f"{name}-color.png") for name in names]
    depths = [read_depth(folder / f"{name}-depth.png", "mm") for name in names]
    try:
        found = perceive_frames(colours, depths, CAMERA)
    except NoClothError:
        return
    assert found.motion_share > 0.01
    assert found.quality < 0.3
