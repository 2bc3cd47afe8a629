"""The z-buffer against analytic shapes."""

from __future__ import annotations

import numpy as np
import pytest

from emd_arm_executor.hiro.render.mesh import Mesh, Segment, box, cylinder, merge, sphere
from emd_arm_executor.hiro.render.rasteriser import draw_parallel, draw_perspective
from emd_core.errors import InvalidInputError
from emd_core.frames import FloatArray
from emd_core.pinhole_camera import PinholeCamera

CAMERA = PinholeCamera(160, 120, 150.0, 140.0, 79.5, 59.5)
GREY = (0.5, 0.5, 0.5)


def draw(mesh: Mesh, near: float = 0.05) -> tuple[FloatArray, FloatArray]:
    """Depth (H, W), infinite where nothing is, and the triangle seen."""
    keys = np.zeros((CAMERA.height, CAMERA.width))
    indices = np.full(keys.shape, -1, dtype=np.int32)
    intrinsics = np.array([CAMERA.fx, CAMERA.fy, CAMERA.cx, CAMERA.cy])
    draw_perspective(mesh.vertices, mesh.triangles, intrinsics, near, keys, indices)
    with np.errstate(divide="ignore"):
        return 1.0 / keys, indices


def rays() -> FloatArray:
    """Point at depth 1 of every pixel, shape (H, W, 3)."""
    return CAMERA.unproject(np.ones((CAMERA.height, CAMERA.width)))


def moved(mesh: Mesh, x: float, y: float, z: float, turn: FloatArray | None = None) -> Mesh:
    """The mesh turned and shifted into the camera's view."""
    transform = np.eye(4)
    transform[:3, :3] = np.eye(3) if turn is None else turn
    transform[:3, 3] = (x, y, z)
    return mesh.moved(transform)


def test_tilted_plane_has_analytic_depth() -> None:
    """Every pixel of a large tilted face is where its ray meets the plane, to 1e-9 m."""
    angle = 0.7
    turn = np.array(
        [[1, 0, 0], [0, np.cos(angle), -np.sin(angle)], [0, np.sin(angle), np.cos(angle)]]
    )
    depth, indices = draw(moved(box((8, 8, 0.1), GREY, Segment.TABLE), 0, 0, 2, turn))
    normal = turn @ np.array([0, 0, 1.0])
    point = np.array([0, 0, 2.0]) - 0.05 * normal
    wanted = (point @ normal) / (rays() @ normal)
    seen = (indices >= 0) & np.isclose(depth, wanted, atol=1e-3)
    assert seen.mean() > 0.9
    assert np.abs(depth - wanted)[seen].max() < 1e-9


def test_sphere_has_analytic_depth_within_its_facets() -> None:
    """A tessellated sphere is at most its facets' sag inside the true one, and never outside."""
    radius, sides = 0.3, 64
    depth, indices = draw(moved(sphere(radius, GREY, Segment.ROBOT, sides), 0.1, -0.05, 1.5))
    directions, centre = rays(), np.array([0.1, -0.05, 1.5])
    a, b = (directions**2).sum(-1), directions @ centre
    discriminant = b**2 - a * (centre @ centre - radius**2)
    with np.errstate(invalid="ignore"):
        wanted = (b - np.sqrt(discriminant)) / a
    inner = discriminant > 0.3 * discriminant.max()
    sag = 2 * radius * (1 - np.cos(np.pi / sides))
    error = (depth - wanted)[inner]
    assert (indices[inner] >= 0).all()
    assert error.min() > -1e-9
    assert error.max() < 3 * sag
    assert (indices[discriminant < 0] < 0).all()


def test_silhouette_of_a_box_is_exact() -> None:
    """A box facing the camera covers exactly the pixels whose rays meet its front."""
    depth, indices = draw(moved(box((0.413, 0.2117, 0.5), GREY, Segment.ROBOT), 0.05, 0.02, 1.25))
    at_front = rays() * 1.0
    inside = (np.abs(at_front[..., 0] - 0.05) < 0.2065) & (
        np.abs(at_front[..., 1] - 0.02) < 0.10585
    )
    assert np.array_equal(np.isclose(depth, 1.0), inside)
    assert np.array_equal(indices >= 0, depth < np.inf)


def test_meshes_are_closed_and_face_outwards() -> None:
    """Every primitive's volume by the divergence theorem is its own, positive volume."""
    shapes = {
        2.4: box((1, 2, 1.2), GREY, Segment.ROBOT),
        np.pi * 0.25 * 2: cylinder(0.5, 2, GREY, Segment.ROBOT, sides=200),
        4 / 3 * np.pi * 0.125: sphere(0.5, GREY, Segment.ROBOT, sides=200),
    }
    for volume, mesh in shapes.items():
        a, b, c = np.moveaxis(mesh.vertices[mesh.triangles], 1, 0)
        assert (a * np.cross(b, c)).sum() / 6 == pytest.approx(volume, rel=2e-3)


def test_nearer_thing_hides_the_farther_one_in_any_order() -> None:
    """Occlusion does not depend on the order of drawing."""
    far = moved(box((2, 2, 0.1), GREY, Segment.TABLE), 0, 0, 2)
    close = moved(box((0.2, 0.2, 0.1), GREY, Segment.ROBOT), 0, 0, 1)
    first, _ = draw(merge([far, close]))
    second, _ = draw(merge([close, far]))
    assert np.array_equal(first, second)
    assert first[60, 80] == pytest.approx(0.95)
    assert first[60, 10] == pytest.approx(1.95)


def test_no_gap_between_neighbours() -> None:
    """A face split into many triangles leaves no pixel out."""
    flat = np.linspace(-1, 1, 38)
    x, y = np.meshgrid(flat, flat)
    corners = np.arange(x.size).reshape(x.shape)
    a, b, c, d = corners[:-1, :-1], corners[:-1, 1:], corners[1:, 1:], corners[1:, :-1]
    triangles = np.concatenate(
        [np.stack(t, -1).reshape(-1, 3) for t in ((a, c, b), (a, d, c))]
    ).astype(np.int32)
    vertices = np.stack([x.ravel(), y.ravel(), np.full(x.size, 1.0)], axis=1)
    keys = np.zeros((CAMERA.height, CAMERA.width))
    indices = np.full(keys.shape, -1, dtype=np.int32)
    intrinsics = np.array([CAMERA.fx, CAMERA.fy, CAMERA.cx, CAMERA.cy])
    draw_perspective(vertices, triangles, intrinsics, 0.05, keys, indices)
    assert (indices >= 0).all()
    assert keys == pytest.approx(np.ones_like(keys))


def test_what_reaches_behind_the_camera_is_cut_at_the_near_plane() -> None:
    """A floor that runs under and behind the camera is drawn where it is in front."""
    floor = moved(box((20, 0.1, 20), GREY, Segment.FLOOR), 0, 1.05, 0)
    depth, indices = draw(floor)
    below = rays()[..., 1] > 0.12
    with np.errstate(divide="ignore"):
        wanted = 1.0 / rays()[..., 1]
    assert (indices[below] >= 0).all()
    assert depth[below] == pytest.approx(wanted[below])


def test_back_faces_are_not_drawn() -> None:
    """From inside a box nothing of it is seen."""
    _, indices = draw(box((2, 2, 2), GREY, Segment.ROBOT))
    assert (indices < 0).all()


def test_parallel_light_sees_both_faces_at_their_heights() -> None:
    """In parallel projection the key is the height, whichever way a triangle is turned."""
    vertices = np.array([[1.0, 1, 5], [30, 1, 5], [1, 30, 34]])
    for triangle in ([0, 1, 2], [0, 2, 1]):
        keys = np.full((40, 40), -np.inf)
        indices = np.full(keys.shape, -1, dtype=np.int32)
        draw_parallel(vertices, np.array([triangle], dtype=np.int32), keys, indices)
        assert keys[1, 1] == pytest.approx(5)
        assert keys[11, 5] == pytest.approx(15)
        assert indices[35, 35] == -1


def test_merging_nothing_is_refused() -> None:
    """There is no empty mesh."""
    with pytest.raises(InvalidInputError):
        merge([])
