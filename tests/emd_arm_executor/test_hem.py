"""Hems of squares, turned squares and L-shapes, from fine masks and from voxel grids."""

from __future__ import annotations

import numpy as np
import pytest

from emd_arm_executor.config import HemConfig
from emd_arm_executor.hem import find_hems
from emd_arm_executor.hem_contour import HemContour, extract_hems
from emd_arm_executor.silhouette import Silhouette
from emd_core.errors import InvalidInputError, NoHemError
from emd_core.frames import FloatArray
from emd_core.voxel_grid import voxelise

ANGLES = np.deg2rad([0.0, 7.0, 20.0, 33.0, 45.0])


def _rotation(angle: float) -> FloatArray:
    return np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])


def _voxel_square(angle: float, side: float, centre: FloatArray) -> Silhouette:
    axis = np.linspace(-side / 2, side / 2, 150)
    x, y = np.meshgrid(axis, axis)
    flat = np.stack([x.ravel(), y.ravel()], axis=1) @ _rotation(angle).T + centre
    return Silhouette.from_voxel_grid(voxelise(np.column_stack([flat, np.full(len(flat), 0.002)])))


def _l_shape() -> Silhouette:
    cell = 0.002
    mask = np.zeros((240, 240), dtype=bool)
    mask[20:220, 20:220] = True
    mask[120:220, 120:220] = False
    return Silhouette(mask, np.array([cell, cell]), np.array([-0.24, -0.24]))


@pytest.mark.parametrize("angle", ANGLES)
def test_fine_square_has_four_sharp_corners(towel, angle: float) -> None:
    """From a fine mask the corners come out within half a cell."""
    (contour,) = extract_hems(towel(angle))
    corners = contour.vertices_in_table @ _rotation(angle)
    assert len(corners) == 4
    assert np.abs(np.abs(corners) - 0.2).max() < 0.001


@pytest.mark.parametrize("angle", ANGLES)
def test_voxel_square_has_four_corners_below_a_voxel(angle: float) -> None:
    """From voxels of 18 mm a square keeps four corners, each within one voxel."""
    centre = np.array([0.007, -0.004])
    (contour,) = extract_hems(_voxel_square(angle, 0.36, centre))
    corners = (contour.vertices_in_table - centre) @ _rotation(angle)
    assert len(corners) == 4
    assert np.abs(np.abs(corners) - 0.18).max() < 0.0179


def test_voxel_hems_are_not_biased_outwards() -> None:
    """Voxels that cloth merely touches do not push the hem outwards on average."""
    rng = np.random.default_rng(3)
    errors = []
    for _ in range(40):
        angle, centre = rng.uniform(0, np.pi / 2), rng.uniform(-0.02, 0.02, 2)
        (contour,) = extract_hems(_voxel_square(angle, 0.3, centre))
        errors.extend(
            normal @ (vertex - centre) - 0.15
            for normal, vertex in zip(
                contour.outward_normals, contour.vertices_in_table, strict=True
            )
        )
    assert abs(np.mean(errors)) < 0.001
    assert np.std(errors) < 0.006


@pytest.mark.parametrize("angle", ANGLES)
def test_normals_point_outwards(towel, angle: float) -> None:
    """A step along a normal leaves the cloth, a step against it stays inside."""
    (contour,) = extract_hems(towel(angle))
    ahead = np.roll(contour.vertices_in_table, -1, axis=0)
    middles = (contour.vertices_in_table + ahead) / 2
    for middle, normal in zip(middles, contour.outward_normals, strict=True):
        assert not contour.contains(middle + 0.01 * normal)
        assert contour.contains(middle - 0.01 * normal)
        assert np.linalg.norm(normal) == pytest.approx(1.0)


def test_l_shape_keeps_its_inner_corner() -> None:
    """An L has six corners, the inner one included, and its normals face out of the notch."""
    (contour,) = extract_hems(_l_shape())
    assert len(contour.vertices_in_table) == 6
    assert np.linalg.norm(contour.vertices_in_table, axis=1).min() < 0.001
    hem = find_hems([contour], [-0.01, 0.10], count=1)[0]
    assert hem.outward_normal == pytest.approx([1.0, 0.0], abs=1e-3)


def test_holes_and_specks_are_left_out(towel) -> None:
    """Neither a hole in the cloth nor a speck beside it has a hem."""
    silhouette = towel()
    mask = silhouette.mask.copy()
    mask[150:200, 150:200] = False
    mask[5:10, 5:10] = True
    spoilt = Silhouette(mask, silhouette.resolution, silhouette.origin_in_table)
    (contour,) = extract_hems(spoilt)
    assert np.abs(contour.vertices_in_table).max() < 0.202
    assert len(contour.vertices_in_table) == 4


def test_curved_hem_is_followed() -> None:
    """A round cloth becomes a polygon that stays within the tolerance of the circle."""
    axis = np.arange(-0.3, 0.3, 0.002) + 0.001
    mask = np.hypot(axis[:, None], axis[None]) < 0.2
    silhouette = Silhouette(mask, np.array([0.002, 0.002]), np.array([-0.3, -0.3]))
    (contour,) = extract_hems(silhouette)
    ahead = np.roll(contour.vertices_in_table, -1, axis=0)
    middles = (contour.vertices_in_table + ahead) / 2
    radii = np.linalg.norm(np.concatenate([contour.vertices_in_table, middles]), axis=1)
    assert np.abs(radii - 0.2).max() < 2 * HemConfig().corner_tolerance


def test_nearest_hem_comes_first_and_the_second_lies_elsewhere(towel) -> None:
    """Inside the cloth the nearest edge wins and the second nearest is another edge."""
    first, second = find_hems(towel(), [-0.12, 0.09], count=2)
    assert first.point_in_table == pytest.approx([-0.2, 0.09], abs=1e-3)
    assert first.outward_normal == pytest.approx([-1.0, 0.0], abs=1e-3)
    assert first.inside and first.distance == pytest.approx(0.08, abs=1e-3)
    assert second.edge != first.edge
    assert second.point_in_table == pytest.approx([-0.12, 0.2], abs=1e-3)
    assert second.distance >= first.distance


def test_corner_is_grasped_along_its_bisector(towel) -> None:
    """At a corner the bisector comes first, then both hems that meet there."""
    config = HemConfig()
    hems = find_hems(towel(), [-0.2, -0.2], count=5, config=config)
    assert hems[0].corner
    assert hems[0].point_in_table == pytest.approx([-0.2, -0.2], abs=1e-3)
    assert hems[0].outward_normal == pytest.approx([-(0.5**0.5)] * 2, abs=1e-3)
    for hem in hems[1:3]:
        assert not hem.corner
        distances = np.abs(hem.point_in_table - [-0.2, -0.2])
        assert sorted(distances) == pytest.approx([0.0, config.corner_inset], abs=1e-3)
    assert abs(hems[1].outward_normal @ hems[2].outward_normal) < 1e-3


@pytest.mark.parametrize(("point", "inside"), [([0.0, 0.0], True), ([-0.28, 0.0], False)])
def test_far_hems_are_refused(towel, point: list[float], inside: bool) -> None:
    """A grasp deep inside or far beside the cloth has no hem and says how far it is."""
    with pytest.raises(NoHemError, match="inside" if inside else "outside"):
        find_hems(towel(), point)


def test_no_cloth_has_no_hem() -> None:
    """An empty silhouette is refused with its area."""
    empty = Silhouette(np.zeros((50, 50), dtype=bool), np.array([0.01, 0.01]), np.zeros(2))
    with pytest.raises(NoHemError, match="cm2"):
        extract_hems(empty)


@pytest.mark.parametrize(("point", "count"), [([np.nan, 0.0], 1), ([0.0], 1), ([0.0, 0.0], 0)])
def test_unusable_questions_are_refused(towel, point: list[float], count: int) -> None:
    """A grasp point that is not finite or a count below 1 is refused."""
    with pytest.raises(InvalidInputError):
        find_hems(towel(), point, count)


def test_contours_can_be_passed_on() -> None:
    """Outlines found once serve many grasp points."""
    square = HemContour(np.array([[-0.1, -0.1], [0.1, -0.1], [0.1, 0.1], [-0.1, 0.1]]))
    (hem,) = find_hems([square], [0.0, 0.06], count=1)
    assert hem.point_in_table == pytest.approx([0.0, 0.1])
    assert hem.outward_normal == pytest.approx([0.0, 1.0])
