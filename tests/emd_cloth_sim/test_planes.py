"""Claims about constraints on planes, against plain loops over the mesh."""

import numpy as np
import pytest

from emd_cloth_sim.constraints import hold_lengths, limit_sharpness, resist_bending, resist_shear
from emd_cloth_sim.mesh import build_mesh
from emd_cloth_sim.planes import empty_planes, load_planes, store_planes, to_plane

SPACING = (0.010, 0.008)
MESHES = [(6, 9), (9, 6), (5, 5), (7, 41), (41, 34), (5, 126)]
single = np.float32


def crumpled(vertices: tuple[int, int]) -> np.ndarray:
    """A flat sheet whose vertices are moved at random, shape (V, 3), single precision."""
    i, j = np.indices(vertices)
    flat = np.stack([i * SPACING[0], j * SPACING[1], 0.0 * i], axis=-1).reshape(-1, 3)
    noise = np.random.default_rng(0).normal(scale=0.002, size=flat.shape)
    return (flat + noise).astype(single)


def on_planes(positions: np.ndarray, vertices: tuple[int, int], sweep) -> np.ndarray:  # noqa: ANN001
    """Positions after a sweep, which is given the planes."""
    planes, result = empty_planes(vertices[0]), np.empty_like(positions)
    load_planes(positions, planes, *vertices)
    sweep(planes)
    store_planes(planes, result, *vertices)
    return result


@pytest.mark.parametrize("vertices", MESHES)
def test_there_and_back_again(vertices: tuple[int, int]) -> None:
    """Loading and storing changes nothing."""
    positions = crumpled(vertices)
    assert np.array_equal(on_planes(positions, vertices, lambda planes: None), positions)


@pytest.mark.parametrize("vertices", MESHES)
def test_lengths_are_swept_edge_by_edge(vertices: tuple[int, int]) -> None:
    """The sweep equals a Gauss-Seidel loop over the mesh's edges, each with its own length."""
    mesh = build_mesh(vertices, SPACING)
    lengths = mesh.edge_lengths * np.random.default_rng(1).uniform(0.9, 1.1, len(mesh.edges))
    planes = np.zeros((2, vertices[0] * vertices[1]))
    along_x = mesh.edges[:, 1] - mesh.edges[:, 0] == vertices[1]
    planes[0, mesh.edges[along_x, 0]] = lengths[along_x]
    planes[1, mesh.edges[~along_x, 0]] = lengths[~along_x]
    x, y = (to_plane(plane.reshape(vertices)) for plane in planes)
    compliance = (single(0.2), single(0.5))
    result = on_planes(
        crumpled(vertices), vertices, lambda p: hold_lengths(p, x, y, *vertices, compliance)
    )
    wanted = crumpled(vertices).astype(np.float64)
    for (a, b), length, is_x in zip(mesh.edges, lengths, along_x, strict=True):
        gap = wanted[b] - wanted[a]
        pull = gap * (1 - length / np.linalg.norm(gap)) / (2.2 if is_x else 2.5)
        wanted[a] += pull
        wanted[b] -= pull
    np.testing.assert_allclose(result, wanted, atol=1e-6)


@pytest.mark.parametrize("vertices", MESHES)
def test_bending_is_a_jacobi_sweep_along_x_then_y(vertices: tuple[int, int]) -> None:
    """The sweep equals second differences taken at once, first of columns, then of rows."""
    bend = empty_planes(vertices[0])
    compliance = (single(4.0), single(9.0))
    result = on_planes(
        crumpled(vertices), vertices, lambda p: resist_bending(p, bend, *vertices, compliance)
    )
    wanted = crumpled(vertices).astype(np.float64).reshape(*vertices, 3)
    for axis, divisor in ((0, 20.0), (1, 25.0)):
        rows = np.moveaxis(wanted, axis, 0)
        push = (rows[:-2] - 2 * rows[1:-1] + rows[2:]) / divisor
        rows = rows.copy()
        rows[:-2] -= push
        rows[1:-1] += 2 * push
        rows[2:] -= push
        wanted = np.moveaxis(rows, 0, axis)
    np.testing.assert_allclose(result, wanted.reshape(-1, 3), atol=1e-6)


@pytest.mark.parametrize("vertices", MESHES)
def test_shear_squares_every_triangle(vertices: tuple[int, int]) -> None:
    """Repeated sweeps make the legs of all triangles perpendicular and move no centre."""
    positions = crumpled(vertices)
    leg = single(np.sqrt(SPACING[0] * SPACING[1]))

    def sweep(planes: np.ndarray) -> None:
        for _ in range(60):
            resist_shear(planes, *vertices, leg, single(0.0))

    result = on_planes(positions, vertices, sweep).astype(np.float64)
    corner, one, other = result[build_mesh(vertices, SPACING).right_angles].transpose(1, 0, 2)
    dots = ((one - corner) * (other - corner)).sum(axis=1)
    before, one, other = positions[build_mesh(vertices, SPACING).right_angles].transpose(1, 0, 2)
    first = ((one - before) * (other - before)).sum(axis=1)
    assert np.abs(dots).mean() < 0.05 * np.abs(first).mean()
    np.testing.assert_allclose(result.mean(axis=0), positions.mean(axis=0), atol=1e-6)


@pytest.mark.parametrize("vertices", MESHES)
def test_sharpness_is_limited_on_every_span(vertices: tuple[int, int]) -> None:
    """Repeated sweeps part all vertices two edges or a diagonal apart, and leave wide ones."""
    spans = build_mesh(vertices, SPACING).spans
    shortest = (single(0.012), single(0.012), single(0.008))

    def sweep(planes: np.ndarray) -> None:
        for _ in range(80):
            limit_sharpness(planes, *vertices, *shortest)

    positions = crumpled(vertices)
    result = on_planes(positions, vertices, sweep)
    gaps = np.linalg.norm(result[spans[:, 0]] - result[spans[:, 1]], axis=1)
    assert gaps.min() > 0.97 * 0.008
    calm = np.full_like(positions, 0.0)
    calm[:, :2] = np.indices(vertices).reshape(2, -1).T * SPACING
    assert np.array_equal(on_planes(calm, vertices, sweep), calm)
