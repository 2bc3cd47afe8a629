"""Depth drawn as another camera sees it."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from emd_core.errors import InvalidInputError
from emd_core.pinhole_camera import PinholeCamera
from emd_perception.registration import arrange_points, draw_depth

COLOUR = PinholeCamera(160, 120, 131.0, 131.0, 79.5, 59.5)
DEPTH = PinholeCamera(160, 120, 145.0, 145.0, 77.0, 62.0)
TURN = np.eye(4)
TURN[:3, :3] = Rotation.from_rotvec([0.01, -0.02, 0.005]).as_matrix()
TURN[:3, 3] = [0.025, 0.001, 0.002]
NORMAL = np.array([0.05, -0.45, -0.9]) / np.linalg.norm([0.05, -0.45, -0.9])
DISTANCE = 0.83


def plane_depth(camera: PinholeCamera, normal: np.ndarray, distance: float) -> np.ndarray:
    """Depth of the plane normal . p + distance = 0."""
    rays = camera.unproject(np.ones((camera.height, camera.width)))
    return -distance / (rays @ normal)


def plane_in_colour() -> tuple[np.ndarray, float]:
    """The same plane in the colour camera's frame."""
    normal = TURN[:3, :3] @ NORMAL
    return normal, DISTANCE - normal @ TURN[:3, 3]


@pytest.mark.parametrize("factor", [0.5, 1, 2.5])
def test_a_tilted_plane_stays_itself_at_any_resolution(factor) -> None:
    """Finer, equal or coarser than the depth camera: no hole, no bias, 0.01 mm inside."""
    camera = PinholeCamera(
        int(160 * factor), int(120 * factor), 131.0 * factor, 131.0 * factor,
        79.5 * factor, 59.5 * factor,
    )  # fmt: skip
    drawn = draw_depth(DEPTH.unproject(plane_depth(DEPTH, NORMAL, DISTANCE)), camera, TURN)
    truth = plane_depth(camera, *plane_in_colour())
    margin = int(22 * factor)
    inner = np.s_[margin:-margin, margin:-margin]
    assert np.isfinite(drawn[inner]).all()
    np.testing.assert_allclose(drawn[inner], truth[inner], atol=1e-5)


def test_the_same_camera_gives_the_same_image() -> None:
    """With the identity between them, depth and gaps stay where they are."""
    depth = plane_depth(COLOUR, NORMAL, DISTANCE)
    depth[40:50, 60:80] = np.nan
    drawn = draw_depth(COLOUR.unproject(depth), COLOUR, np.eye(4))
    np.testing.assert_allclose(drawn, depth, atol=1e-6)


def test_a_near_thing_hides_what_is_behind_it() -> None:
    """A box before the plane keeps its own depth, with nothing drawn between the two."""
    depth = plane_depth(DEPTH, NORMAL, DISTANCE)
    depth[50:70, 60:90] = 0.5
    drawn = draw_depth(DEPTH.unproject(depth), COLOUR, TURN)
    truth = plane_depth(COLOUR, *plane_in_colour())
    known = np.isfinite(drawn)
    box = np.abs(drawn - 0.5) < 0.02
    table = np.abs(drawn - truth) < 0.005
    assert box.sum() > 300
    assert (box | table)[known].all()


def test_a_cloud_without_order_gives_the_same_surface() -> None:
    """Points in random order, a quarter of a picture's, give most pixels, without bias."""
    points = DEPTH.unproject(plane_depth(DEPTH, NORMAL, DISTANCE)).reshape(-1, 3)
    chosen = points[np.random.default_rng(0).permutation(len(points))[: len(points) // 4]]
    chosen[::50] = np.nan
    drawn = draw_depth(arrange_points(chosen, COLOUR, TURN), COLOUR, TURN)
    truth = plane_depth(COLOUR, *plane_in_colour())
    known = np.isfinite(drawn)
    assert known[25:-25, 25:-25].mean() > 0.85
    assert abs((drawn - truth)[known].mean()) < 1e-4
    assert np.abs((drawn - truth)[known]).max() < 0.006


@pytest.mark.parametrize(
    "points",
    [
        np.full((3, 3, 3), np.nan),
        np.zeros((3, 3, 3)),
        np.full((3, 3, 3), 1e30),
        -np.ones((2, 2, 3)),
    ],
    ids=["unknown", "in the lens", "far", "behind"],
)
def test_points_that_nobody_sees_give_an_empty_image(points) -> None:
    """Neither a crash nor a depth."""
    assert np.isnan(draw_depth(points, COLOUR, np.eye(4))).all()
    assert np.isnan(arrange_points(points.reshape(-1, 3), COLOUR, np.eye(4))).all()


def test_points_of_another_shape_are_refused() -> None:
    """A list of points has no neighbours."""
    with pytest.raises(InvalidInputError, match="shape"):
        draw_depth(np.zeros((5, 3)), COLOUR, np.eye(4))
