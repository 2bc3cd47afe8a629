"""Tests of the points of a mask: against plain unprojection and SciPy's distance transform."""

import numpy as np
from scipy.ndimage import distance_transform_edt

from emd_core.frames import transform_points
from emd_core.pinhole_camera import PinholeCamera
from emd_perception.masked_surface import masked_surface

CAMERA = PinholeCamera(80, 60, 65.0, 70.0, 40.0, 29.0)
DOWN = np.array([[0.0, -1, 0, 0.1], [-1, 0, 0, 0.2], [0, 0, -1, 0.9], [0, 0, 0, 1]])


def images(unknown_share: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Colour, depth without some pixels, and a ragged mask."""
    rng = np.random.default_rng(7)
    colour = rng.integers(0, 256, (60, 80, 3)).astype(np.uint8)
    depth = (0.88 + 0.005 * rng.random((60, 80))).astype(np.float32)
    depth[rng.random(depth.shape) < unknown_share] = np.nan
    mask = np.zeros(depth.shape, bool)
    mask[10:50, 20:70] = rng.random((40, 50)) < 0.9
    return colour, depth, mask


def test_known_pixels_are_unprojected_with_their_colours() -> None:
    """The points are those of the camera's model, in the mask's order."""
    colour, depth, mask = images(0.3)
    found = masked_surface(colour, depth, mask, CAMERA, DOWN, 0.02)
    known = mask & np.isfinite(depth)
    wanted = transform_points(DOWN, CAMERA.unproject(depth)[known])
    np.testing.assert_allclose(found.known_points_in_table, wanted, atol=1e-6)
    np.testing.assert_array_equal(found.known_colours, colour[known])
    assert found.known_share == known.sum() / mask.sum()


def test_unknown_pixels_take_the_height_of_the_nearest_known_one() -> None:
    """Whole rows and columns without depth too; nearest as SciPy has it, ties apart."""
    colour, depth, mask = images(0.5)
    depth[20:28], depth[:, 40:46] = np.nan, np.nan
    found = masked_surface(colour, depth, mask, CAMERA, DOWN, 0.02)
    known = mask & np.isfinite(depth)
    distance = distance_transform_edt(~known)
    rows, columns = np.nonzero(mask)
    # Looking straight down, a footprint tells the depth that a pixel was given.
    given = (0.1 - found.footprint_in_table[:, 0]) * CAMERA.fy / (rows - CAMERA.cy + 1e-12)
    checked = np.flatnonzero(~known[mask] & (rows != CAMERA.cy))
    assert len(checked) > 500
    for index in checked:
        row, column = rows[index], columns[index]
        far = np.hypot(*(np.argwhere(known) - (row, column)).T)
        nearest = depth[known][np.isclose(far, distance[row, column])]
        assert np.abs(nearest - given[index]).min() < 1e-6


def test_spikes_count_as_unknown() -> None:
    """A pixel 3 cm nearer than all around it gives no point."""
    colour, depth, mask = images(0.0)
    mask[30, 40] = True
    depth[30, 40] -= 0.03
    found = masked_surface(colour, depth, mask, CAMERA, DOWN, 0.02)
    assert len(found.known_points_in_table) == mask.sum() - 1
    assert found.known_points_in_table[:, 2].max() < 0.03


def test_without_any_depth_there_is_no_surface() -> None:
    """Nothing known: no points, no footprint, a share of 0."""
    colour, depth, mask = images(0.0)
    depth[...] = np.nan
    found = masked_surface(colour, depth, mask, CAMERA, DOWN, 0.02)
    assert len(found.known_points_in_table) == len(found.footprint_in_table) == 0
    assert found.known_share == 0.0
