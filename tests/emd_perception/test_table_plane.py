"""Tests of the table's plane."""

import numpy as np
import pytest

from emd_core.errors import InvalidInputError
from emd_core.pinhole_camera import PinholeCamera
from emd_perception.image_types import DepthImage
from emd_perception.table_plane import fit_plane_to_pixels, fit_table_plane
from emd_perception.unprojection import pixel_rays

CAMERA = PinholeCamera(160, 120, 131.0, 131.0, 79.5, 59.5)
NORMAL = np.array([0.05, -0.45, -0.9]) / np.linalg.norm([0.05, -0.45, -0.9])
PLANE = np.array([*NORMAL, 0.83])


def depth_of(plane: np.ndarray, noise: float = 0.0, seed: int = 0) -> DepthImage:
    """Depth image of a plane, with normal noise along the optical axis."""
    depth = -plane[3] / (pixel_rays(CAMERA) @ plane[:3])
    rng = np.random.default_rng(seed)
    return (depth + rng.normal(0.0, 1.0, depth.shape) * noise).astype(np.float32)


def angle(one: np.ndarray, other: np.ndarray) -> float:
    """Angle between the normals of two planes, radians."""
    return float(np.linalg.norm(np.cross(one[:3], other[:3])))


def test_a_clean_plane_is_found_exactly() -> None:
    """Without noise the plane is found to a hundredth of a millimetre, all points on it."""
    found = fit_table_plane(depth_of(PLANE), CAMERA)
    np.testing.assert_allclose(found.coefficients, PLANE, atol=1e-5)
    assert found.inlier_share == 1.0


def test_the_normal_has_length_one_and_points_to_the_camera() -> None:
    """The camera lies on the normal's side of the table, d metres away."""
    found = fit_table_plane(depth_of(PLANE, 0.002), CAMERA).coefficients
    assert np.linalg.norm(found[:3]) == pytest.approx(1.0)
    assert found[3] > 0


def test_noise_and_things_on_the_table_do_not_move_the_plane() -> None:
    """With 2 mm of noise, drop-outs and a box over a quarter of the view it stays to 0.5 mm."""
    depth = depth_of(PLANE, 0.002)
    depth[:60, :80] -= 0.12
    depth[::7] = np.nan
    found = fit_table_plane(depth, CAMERA)
    assert angle(found.coefficients, PLANE) < 2e-3
    assert found.coefficients[3] == pytest.approx(PLANE[3], abs=5e-4)
    assert 0.7 < found.inlier_share < 0.85


def test_only_masked_pixels_take_part() -> None:
    """A mask that leaves the larger plane out yields the smaller one."""
    depth = depth_of(PLANE)
    shelf = PLANE - [0, 0, 0, 0.2]
    depth[:40] = depth_of(shelf)[:40]
    mask = np.zeros(depth.shape, bool)
    mask[:40] = True
    np.testing.assert_allclose(
        fit_table_plane(depth, CAMERA, mask=mask).coefficients, shelf, atol=1e-5
    )


def test_the_same_image_gives_the_same_plane() -> None:
    """RANSAC is seeded: five runs give the same bits."""
    depth = depth_of(PLANE, 0.003)
    depth[:60, :80] -= 0.05
    runs = {tuple(fit_table_plane(depth, CAMERA).coefficients) for _ in range(5)}
    assert len(runs) == 1


def test_too_few_points_are_refused() -> None:
    """A plane cannot be found in hardly any depth."""
    depth = np.full((120, 160), np.nan, np.float32)
    depth[:4, :4] = 1.0
    with pytest.raises(InvalidInputError, match="16"):
        fit_table_plane(depth, CAMERA)


def test_a_plane_nearly_known_is_refined_to_the_one_that_is_found_without() -> None:
    """From 3 mm and half a degree off it comes within 0.2 mm of RANSAC's, also beside a box."""
    depth = depth_of(PLANE, 0.002)
    depth[:60, :80] -= 0.12
    pixels = np.flatnonzero(np.isfinite(depth))
    tilted = PLANE + [0.008, 0.0, 0.0, 0.003]
    nearly = tilted / np.linalg.norm(tilted[:3])
    tried_out = fit_plane_to_pixels(depth, CAMERA, pixels)
    refined = fit_plane_to_pixels(depth, CAMERA, pixels, nearly=nearly)
    assert angle(refined.coefficients, tried_out.coefficients) < 5e-4
    assert refined.coefficients[3] == pytest.approx(tried_out.coefficients[3], abs=2e-4)
    assert refined.inlier_share == pytest.approx(tried_out.inlier_share, abs=0.01)


def test_a_plane_that_few_points_support_is_looked_for_anew() -> None:
    """From 5 cm off the very plane of RANSAC is found."""
    depth = depth_of(PLANE, 0.002)
    pixels = np.flatnonzero(np.isfinite(depth))
    far = PLANE + [0.0, 0.0, 0.0, 0.05]
    found = fit_plane_to_pixels(depth, CAMERA, pixels, nearly=far).coefficients
    np.testing.assert_array_equal(found, fit_plane_to_pixels(depth, CAMERA, pixels).coefficients)
