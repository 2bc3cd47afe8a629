"""Claims about the regular mesh."""

import numpy as np

from emd_cloth_sim.mesh import build_mesh, flat_positions

VERTICES, SPACING = (7, 6), (0.02, 0.03)
FLAT = flat_positions(VERTICES, (6 * SPACING[0], 5 * SPACING[1]))


def test_triangles_tile_the_sheet() -> None:
    """All triangles are counter-clockwise from above and their areas add up to the sheet's."""
    corners = FLAT[build_mesh(VERTICES, SPACING).triangles]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    assert (normals[:, 2] > 0).all()
    assert np.isclose(0.5 * normals[:, 2].sum(), 0.12 * 0.15)


def test_rest_shape_satisfies_all_constraints() -> None:
    """On the flat sheet edges have their lengths, triples are straight, right angles are right."""
    mesh = build_mesh(VERTICES, SPACING)
    ends = FLAT[mesh.edges]
    np.testing.assert_allclose(np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1), mesh.edge_lengths)
    spans = FLAT[mesh.spans]
    np.testing.assert_allclose(
        np.linalg.norm(spans[:, 1] - spans[:, 0], axis=1), mesh.span_lengths
    )
    first, middle, last = FLAT[mesh.triples].transpose(1, 0, 2)
    np.testing.assert_allclose(first + last, 2 * middle, atol=1e-12)
    corner, one, other = FLAT[mesh.right_angles].transpose(1, 0, 2)
    np.testing.assert_allclose(((one - corner) * (other - corner)).sum(axis=1), 0, atol=1e-15)


def test_every_triangle_has_one_right_angle() -> None:
    """The shear constraints cover each triangle exactly once."""
    mesh = build_mesh(VERTICES, SPACING)
    wanted = {tuple(t) for t in np.sort(mesh.triangles, axis=1)}
    got = {tuple(t) for t in np.sort(mesh.right_angles, axis=1)}
    assert got == wanted and len(mesh.right_angles) == len(mesh.triangles)


def test_mesh_is_mirror_symmetric() -> None:
    """With an even number of cells, mirroring the sheet maps the triangles onto themselves."""
    index = np.arange(49).reshape(7, 7)
    mesh = build_mesh((7, 7), (0.1, 0.1))
    triangles = {tuple(t) for t in np.sort(mesh.triangles, axis=1)}
    for mirrored in (index[::-1].ravel(), index[:, ::-1].ravel(), index.T.ravel()):
        assert {tuple(t) for t in np.sort(mirrored[mesh.triangles], axis=1)} == triangles
