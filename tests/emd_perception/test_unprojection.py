"""Tests of unprojection."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from emd_core.errors import InvalidInputError
from emd_core.pinhole_camera import PinholeCamera
from emd_perception.unprojection import (
    height_above_plane,
    pixel_rays,
    pixels_near_plane,
    unproject_mask,
)

CAMERA = PinholeCamera(64, 48, 60.0, 55.0, 30.0, 25.0)


@settings(deadline=None)
@given(u=st.integers(0, 63), v=st.integers(0, 47), depth=st.floats(0.3, 5.0))
def test_projection_undoes_unprojection(u: int, v: int, depth: float) -> None:
    """A pixel's point projects onto that pixel, and lies at its depth."""
    image = np.full((48, 64), np.nan, dtype=np.float32)
    image[v, u] = depth
    points = unproject_mask(image, np.ones(image.shape, bool), CAMERA)
    assert points.shape == (1, 3)
    assert points[0, 2] == np.float32(depth)
    np.testing.assert_allclose(CAMERA.project(points), [[u, v]], atol=1e-9)


def test_masked_points_are_those_of_the_whole_image() -> None:
    """The masked points equal the pixels of the whole unprojected image, row by row."""
    rng = np.random.default_rng(0)
    depth = rng.uniform(0.5, 2.0, (48, 64)).astype(np.float32)
    depth[rng.random(depth.shape) < 0.2] = np.nan
    mask = rng.random(depth.shape) < 0.3
    whole = CAMERA.unproject(depth.astype(np.float64))[mask]
    expected = whole[np.isfinite(whole).all(axis=1)]
    np.testing.assert_allclose(unproject_mask(depth, mask, CAMERA), expected, rtol=1e-6)


def test_height_is_the_signed_distance_from_the_plane() -> None:
    """Heights equal the points' scalar product with the plane, NaN where the depth is."""
    normal = np.array([0.1, -0.4, -0.9])
    plane = np.array([*(normal / np.linalg.norm(normal)), 0.8])
    depth = np.random.default_rng(1).uniform(0.5, 2.0, (48, 64)).astype(np.float32)
    depth[5, 6] = np.nan
    height = height_above_plane(depth, plane, CAMERA)
    expected = (pixel_rays(CAMERA) * depth[..., None]) @ plane[:3] + plane[3]
    assert height.dtype == np.float32
    np.testing.assert_allclose(height, expected, atol=1e-6)
    assert np.isnan(height[5, 6])


def test_an_image_of_another_size_is_refused() -> None:
    """Intrinsics that belong to another image size are refused."""
    depth = np.ones((24, 32), dtype=np.float32)
    with pytest.raises(InvalidInputError, match="64 x 48"):
        unproject_mask(depth, np.ones(depth.shape, bool), CAMERA)
    with pytest.raises(InvalidInputError, match="64 x 48"):
        height_above_plane(depth, np.array([0.0, 0.0, -1.0, 1.0]), CAMERA)


def test_pixels_near_a_plane_are_those_of_small_height() -> None:
    """The same pixels as by the height image, unknown ones never, only where allowed."""
    plane = np.array([0.0, -0.6, -0.8, 0.9])
    depth = np.random.default_rng(2).uniform(0.9, 1.3, (48, 64)).astype(np.float32)
    depth[::5] = np.nan
    allowed = np.random.default_rng(3).random(depth.shape) < 0.5
    near = np.abs(height_above_plane(depth, plane, CAMERA)) < 0.1
    assert 100 < near.sum() < near.size - 100
    found = pixels_near_plane(depth, plane, CAMERA, 0.1)
    np.testing.assert_array_equal(found, np.flatnonzero(near))
    found = pixels_near_plane(depth, plane, CAMERA, 0.1, allowed)
    np.testing.assert_array_equal(found, np.flatnonzero(near & allowed))
