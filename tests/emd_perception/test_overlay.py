"""Tests of the pictures that show what was found."""

import numpy as np
import pytest

from emd_core.errors import InvalidInputError
from emd_core.pinhole_camera import PinholeCamera
from emd_perception.overlay import draw_mask, draw_overlay
from emd_perception.pipeline import perceive


def test_only_the_mask_is_tinted() -> None:
    """Pixels outside the mask stay as they are, those inside change, the input stays."""
    colour = np.full((40, 50, 3), 100, np.uint8)
    mask = np.zeros((40, 50), bool)
    mask[10:30, 15:35] = True
    drawn = draw_mask(colour, mask)
    np.testing.assert_array_equal(drawn[~mask], colour[~mask])
    assert (drawn[mask] != colour[mask]).any(axis=1).all()
    assert (colour == 100).all()


def test_image_and_mask_of_different_size_are_refused() -> None:
    """A mask of another image cannot be drawn."""
    with pytest.raises(InvalidInputError, match="same size"):
        draw_mask(np.zeros((40, 50, 3), np.uint8), np.zeros((20, 50), bool))


def test_the_overlay_shows_the_axes_from_the_tables_origin(flat_scene) -> None:
    """The red x axis starts at the origin's pixel and runs down the picture."""
    camera = PinholeCamera()
    found = perceive(
        flat_scene.colour, flat_scene.depth_frames[0], camera, flat_scene.transform_camera_to_table
    )
    drawn = draw_overlay(found, camera).astype(int)
    assert drawn.shape == (480, 640, 3)
    transform_table_to_camera = np.linalg.inv(found.transform_camera_to_table)
    u, v = np.rint(camera.project(transform_table_to_camera[:3, 3])).astype(int)
    red = (drawn[..., 0] > 200) & (drawn[..., 1] < 60) & (drawn[..., 2] < 60)
    assert red[v + 5 : v + 25, u - 1 : u + 2].any(axis=1).all()
    assert not red[: v - 3].any()


def test_a_field_of_view_behind_the_camera_is_drawn_as_far_as_it_is_seen(flat_scene) -> None:
    """Corners that the camera cannot see do not break the drawing."""
    from dataclasses import replace

    from emd_core.frames import FieldOfView
    from emd_core.voxel_grid import voxelise

    camera = PinholeCamera()
    found = perceive(flat_scene.colour, flat_scene.depth_frames[0], camera)
    huge = replace(found, voxel_grid=voxelise(np.zeros((0, 3)), FieldOfView(20.0)))
    assert draw_overlay(huge, camera).shape == (480, 640, 3)
