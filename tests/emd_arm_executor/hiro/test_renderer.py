"""Pictures of the cell: metric depth, what hides what, colours of the cloth."""

from __future__ import annotations

import numpy as np
import pytest

from emd_arm_executor.hiro.cell_geometry import transform_camera_to_waist
from emd_arm_executor.hiro.description import INITIAL, OBSERVE
from emd_arm_executor.hiro.overview import look_at
from emd_arm_executor.hiro.render.mesh import Segment
from emd_arm_executor.hiro.render.renderer import Picture, RenderConfig, Renderer
from emd_arm_executor.hiro.world import HiroWorld
from emd_core.errors import InvalidInputError
from emd_core.frames import FloatArray, transform_points
from emd_core.pinhole_camera import PinholeCamera

CAMERA = PinholeCamera()
HEAD_VIEW = transform_camera_to_waist(*OBSERVE.positions("head"))


@pytest.fixture(scope="module")
def links() -> tuple[str, ...]:
    """Names of the robot's links."""
    with HiroWorld() as world:
        return world.links


@pytest.fixture(scope="module")
def renderer(links: tuple[str, ...]) -> Renderer:
    """A renderer with the default look."""
    return Renderer(links)


def points_in_table(renderer: Renderer, picture: Picture, view: FloatArray) -> FloatArray:
    """Every pixel's point in the table frame, shape (H, W, 3)."""
    to_table = renderer.geometry.transform_waist_to_table @ view
    return transform_points(to_table, CAMERA.unproject(picture.depth))


def test_table_is_flat_and_at_height_zero(renderer: Renderer) -> None:
    """Every table pixel of the head camera unprojects to z = 0 of the table frame."""
    picture = renderer.render(CAMERA, HEAD_VIEW)
    on_table = picture.segmentation == Segment.TABLE
    points = points_in_table(renderer, picture, HEAD_VIEW)
    assert on_table.mean() > 0.95
    assert np.abs(points[on_table][:, 2]).max() < 1e-6


def test_cloth_is_seen_at_its_upper_surface(renderer: Renderer, cloth) -> None:
    """A cloth flat on the desk is seen one thickness above it, inside its outline."""
    picture = renderer.render(CAMERA, HEAD_VIEW, cloth=cloth)
    points = points_in_table(renderer, picture, HEAD_VIEW)[picture.segmentation == Segment.CLOTH]
    top = points[points[:, 2] > cloth.thickness - 1e-6]
    assert len(top) > 0.99 * len(points)
    assert np.abs(top[:, 2] - cloth.thickness).max() < 1e-6
    assert np.abs(points[:, :2]).max() < 0.2 + 1e-6
    area = 0.4**2 * CAMERA.fx * CAMERA.fy / 0.71**2
    assert len(points) == pytest.approx(area, rel=0.05)


def test_turned_cloth_shows_its_inside_at_the_same_height(renderer: Renderer, make_cloth) -> None:
    """A cloth upside down has the other colour, and its seen surface is as high."""
    turned = make_cloth()
    turned.points[:, 1] *= -1
    for cloth, colour in (
        (make_cloth(), renderer.config.cloth_outside),
        (turned, renderer.config.cloth_inside),
    ):
        picture = renderer.render(CAMERA, HEAD_VIEW, cloth=cloth)
        seen = picture.segmentation == Segment.CLOTH
        points = points_in_table(renderer, picture, HEAD_VIEW)[seen]
        assert np.median(points[:, 2]) == pytest.approx(cloth.thickness, abs=1e-6)
        shade = np.median(picture.colour[seen] / 255.0, axis=0)
        assert shade / shade.max() == pytest.approx(np.array(colour) / max(colour), abs=0.02)


def test_lifted_cloth_hides_the_table_and_throws_a_shadow(renderer: Renderer, make_cloth) -> None:
    """A cloth in the air is nearer than the table behind it and darkens some of it."""
    lifted = make_cloth(side=0.2, height=0.15)
    empty = renderer.render(CAMERA, HEAD_VIEW)
    picture = renderer.render(CAMERA, HEAD_VIEW, cloth=lifted)
    seen = picture.segmentation == Segment.CLOTH
    assert (picture.depth[seen] < empty.depth[seen] - 0.1).all()
    still_table = (picture.segmentation == Segment.TABLE) & (empty.segmentation == Segment.TABLE)
    darker = picture.colour[still_table].astype(int) < empty.colour[still_table].astype(int) - 20
    assert darker.all(axis=1).sum() > 2000


def test_hand_hides_the_cloth_under_it(renderer: Renderer, cloth) -> None:
    """Hands over the cloth are seen as robot, nearer than the cloth."""
    with HiroWorld(posture=INITIAL) as world:
        transforms = world.link_transforms_in_waist()
    without = renderer.render(CAMERA, HEAD_VIEW, cloth=cloth)
    picture = renderer.render(CAMERA, HEAD_VIEW, transforms, cloth)
    hidden = (without.segmentation == Segment.CLOTH) & (picture.segmentation == Segment.ROBOT)
    assert hidden.sum() > 3000
    assert (picture.depth[hidden] < without.depth[hidden]).all()


def test_observe_posture_leaves_the_picture_to_the_table(renderer: Renderer, world) -> None:
    """In the observe posture only the waist is seen of the robot, outside |x|, |y| < 0.25 m."""
    picture = renderer.render(CAMERA, HEAD_VIEW, world.link_transforms_in_waist())
    robot = picture.segmentation == Segment.ROBOT
    points = points_in_table(renderer, picture, HEAD_VIEW)
    waist = np.array([*renderer.geometry.table_origin_in_waist[:2]])
    assert (np.hypot(*(points[robot][:, :2] - waist).T) < 0.15).all()
    # Where those rays would have met the table:
    eye = (renderer.geometry.transform_waist_to_table @ HEAD_VIEW)[:3, 3]
    rays = points[robot] - eye
    on_table = eye + rays * (-eye[2] / rays[:, 2])[:, None]
    assert not (np.abs(on_table[:, :2]).max(axis=1) < 0.25).any()


@pytest.mark.parametrize("eye", [(1.2, 0.7, 0.9), (0.9, -0.9, 0.4), (0.3, 0.05, 1.6)])
def test_depth_equals_pybullets_rays(links: tuple[str, ...], eye) -> None:
    """Depths of the robot's solids are those of PyBullet's ray test, but for the facets' sag."""
    view = look_at(np.array(eye), np.array([0.05, 0.0, 0.35]))
    solids = Renderer(links, config=RenderConfig(solids=True))
    rng = np.random.default_rng(3)
    with HiroWorld(posture=INITIAL) as world:
        picture = solids.render(CAMERA, view, world.link_transforms_in_waist())
        points = transform_points(view, CAMERA.unproject(picture.depth.astype(np.float64)))
        rows, columns = np.nonzero(picture.segmentation == Segment.ROBOT)
        above = points[rows, columns, 2] > 0.02  # the pedestal is drawn but is not in PyBullet
        chosen = rng.choice(np.nonzero(above)[0], 400, replace=False)
        errors = []
        for row, column in zip(rows[chosen], columns[chosen], strict=True):
            point = points[row, column]
            found = world.ray_distance(eye, eye + 1.5 * (point - eye))
            errors.append(found - np.linalg.norm(point - eye))
    # Flat faces agree exactly. Cylinders are drawn with 36 facets, up to 0.3 mm within the true
    # surface, which is more along a grazing ray; a few rays pass a silhouette on the other side.
    assert np.median(np.abs(errors)) < 1e-6
    assert np.mean(np.abs(errors) < 1e-3) > 0.9
    assert np.mean(np.abs(errors) < 5e-3) > 0.98


def test_empty_directions_have_no_depth(renderer: Renderer) -> None:
    """A camera that looks up sees the background and NaN."""
    view = look_at(np.array([0.5, 0.0, 0.5]), np.array([1.0, 0.0, 2.0]))
    picture = renderer.render(CAMERA, view)
    assert np.isnan(picture.depth).all()
    assert (picture.segmentation == Segment.NOTHING).all()
    background = np.round(255 * np.array(renderer.config.background))
    assert (picture.colour == background).all()


def test_photograph_averages_a_finer_picture(renderer: Renderer, cloth) -> None:
    """With one sample it is the picture itself; with more, edges get mixed colours."""
    picture = renderer.render(CAMERA, HEAD_VIEW, cloth=cloth)
    one = renderer.photograph(CAMERA, HEAD_VIEW, cloth=cloth, samples=1)
    two = renderer.photograph(CAMERA, HEAD_VIEW, cloth=cloth, samples=2)
    assert np.array_equal(one, picture.colour)
    assert two.shape == one.shape
    difference = np.abs(two.astype(int) - one).max(axis=2)
    assert np.median(difference) <= 4
    assert difference.max() > 20


def test_same_scene_gives_the_same_picture(renderer: Renderer, cloth) -> None:
    """Rendering has no hidden state."""
    first = renderer.render(CAMERA, HEAD_VIEW, cloth=cloth)
    renderer.render(CAMERA, look_at(np.array([1.0, 1, 1]), np.zeros(3)))
    second = renderer.render(CAMERA, HEAD_VIEW, cloth=cloth)
    assert np.array_equal(first.colour, second.colour)
    assert np.array_equal(first.depth, second.depth, equal_nan=True)


@pytest.mark.parametrize(
    "wrong",
    [{"cloth_outside": (2.0, 0, 0)}, {"light_direction": (0.0, 0, 0)}, {"shadow_size": 0}],
)
def test_impossible_looks_are_refused(wrong) -> None:
    """Colours outside 0..1, light from nowhere and empty pictures raise."""
    with pytest.raises(InvalidInputError):
        RenderConfig(**wrong)
