"""Claims about finding crossings and contacts, by brute force, and about impact zones."""

import numpy as np
import pytest

from emd_cloth_sim.broad_phase import make_patches
from emd_cloth_sim.cloth import Cloth
from emd_cloth_sim.config import ClothConfig
from emd_cloth_sim.contact_pairs import allocate_candidates, allocate_motion, allocate_segments
from emd_cloth_sim.contact_search import list_pairs, search_pair
from emd_cloth_sim.crossings import EVERYWHERE, find_crossings
from emd_cloth_sim.edge_contact import allocate_edge_pairs, collide_edges
from emd_cloth_sim.impact_zones import allocate_zones, undo_crossings
from emd_cloth_sim.mesh import SheetMesh, build_mesh, feature_owners

VERTICES = (14, 11)
SPACING = (0.01, 0.01)
MESH = build_mesh(VERTICES, SPACING)
single = np.float32


def tangled(seed: int) -> np.ndarray:
    """A sheet rolled and shaken until it passes through itself, shape (V, 3)."""
    rng = np.random.default_rng(seed)
    i, j = np.indices(VERTICES) * SPACING[0]
    turn = i / 0.014
    points = np.stack([0.012 * np.cos(turn), j, 0.012 * np.sin(turn)], axis=-1).reshape(-1, 3)
    return (points + rng.normal(scale=0.0012, size=points.shape)).astype(single)


def rolled() -> np.ndarray:
    """A sheet rolled up loosely, shape (V, 3)."""
    i, j = np.indices(VERTICES) * SPACING[0]
    turn, radius = 60.0 * i, 0.01 + 0.04 * i
    points = np.stack([radius * np.cos(turn), j, radius * np.sin(turn)], axis=-1)
    return points.reshape(-1, 3).astype(single)


def sides_through_triangles(positions: np.ndarray, mesh: SheetMesh) -> set[tuple]:
    """All crossings, as the sorted ends of the side and the triangle, by testing every pair."""
    sides = np.unique(
        np.sort(np.concatenate([mesh.triangles[:, [k, (k + 1) % 3]] for k in range(3)]), axis=1),
        axis=0,
    )
    start, way = positions[sides[:, 0]], positions[sides[:, 1]] - positions[sides[:, 0]]
    found = set()
    for triangle in mesh.triangles:
        a, b, c = positions[triangle].astype(np.float64)
        # start + t way = a + u (b - a) + v (c - a)
        matrix = np.stack([-way, np.tile(b - a, (len(way), 1)), np.tile(c - a, (len(way), 1))], -1)
        crossing = np.abs(np.linalg.det(matrix)) > 1e-15
        free = np.full((len(way), 3), -1.0)
        free[crossing] = np.linalg.solve(matrix[crossing], (start - a)[crossing, :, None])[..., 0]
        t, u, v = free.T
        inside = (t > 0) & (t < 1) & (u > 0) & (v > 0) & (u + v < 1)
        apart = ~np.isin(sides, triangle).any(axis=1)
        found |= {(*sides[n], *triangle) for n in np.flatnonzero(inside & apart)}
    return found


def crossings_of(positions: np.ndarray) -> set[tuple]:
    """What the search finds."""
    found = np.empty((5000, 5), dtype=np.int32)
    count = find_crossings(
        positions, MESH.triangles, *VERTICES, make_patches(VERTICES), EVERYWHERE, found
    )
    found = found[:count]
    found[:, :2].sort(axis=1)
    return {tuple(row) for row in found.tolist()}


@pytest.mark.parametrize("seed", range(5))
def test_all_crossings_are_found(seed: int) -> None:
    """The search finds just the crossings that testing every side and triangle finds."""
    wanted = sides_through_triangles(tangled(seed), MESH)
    found = crossings_of(tangled(seed))
    assert len(wanted) > 20
    # Ends within a micrometre of a plane may be judged either way.
    assert len(wanted ^ found) <= 0.02 * len(wanted)


def test_clean_sheets_have_no_crossings() -> None:
    """A flat sheet and a rolled one that does not touch itself have none."""
    flat = Cloth(ClothConfig(vertices=VERTICES)).positions_in_table
    for positions in (flat, rolled()):
        assert crossings_of(positions.astype(single)) == set()


def undo(
    position: np.ndarray,
    velocity: np.ndarray,
    safe: np.ndarray,
    mobility: np.ndarray,
    desk: float = -1.0,
) -> tuple[int, int]:
    """Undo crossings in place; returns how many vertices were in zones and edges are watched."""
    pairs = allocate_edge_pairs(500)
    moved = undo_crossings(
        position,
        velocity,
        safe.copy(),
        mobility,
        MESH.triangles,
        *VERTICES,
        make_patches(VERTICES),
        np.empty((5000, 5), dtype=np.int32),
        pairs,
        allocate_zones(len(position)),
        single(desk),
    )
    return moved, int(pairs.length[0])


def into_a_tangle() -> tuple[np.ndarray, np.ndarray]:
    """A clean state, and one with crossings that it moves to; vertex 5 is far from them."""
    safe, rng = rolled(), np.random.default_rng(0)
    position = safe + single(0.002)
    position[60:64] += 0.03 * rng.normal(size=(4, 3)).astype(single)
    position[5] += single(0.001)
    assert crossings_of(safe) == set() and crossings_of(position)
    return safe, position


def test_undoing_leaves_no_crossing() -> None:
    """From a clean state, a step into a tangle is undone as far as needed and no farther."""
    safe, position = into_a_tangle()
    before, velocity = position.copy(), np.ones_like(safe)
    moved, watched = undo(position, velocity, safe, np.ones(len(safe)))
    assert crossings_of(position) == set() and 5 <= moved < len(safe) and watched > 0
    assert np.array_equal(position[5], before[5]) and (velocity[5] == 1.0).all()


def test_zones_keep_momentum() -> None:
    """What was in a tangle moves on together, and as much as its vertices wanted on the whole."""
    safe, position = into_a_tangle()
    velocity = np.random.default_rng(1).normal(size=safe.shape).astype(single)
    wanted, momentum = position.copy(), velocity.sum(axis=0)
    undo(position, velocity, safe, np.ones(len(safe)))
    zone = (position != wanted).any(axis=1)
    assert np.ptp((position - safe)[zone], axis=0).max() < 0.6 * np.ptp((wanted - safe)[zone])
    np.testing.assert_allclose(position.sum(axis=0), wanted.sum(axis=0), atol=1e-5)
    np.testing.assert_allclose(velocity.sum(axis=0), momentum, atol=1e-4)


def test_zones_follow_a_rigid_grip() -> None:
    """A zone with a held vertex goes where this one goes, so that nothing is torn off the hand."""
    safe, position = into_a_tangle()
    velocity, mobility = np.zeros_like(safe), np.ones(len(safe))
    mobility[61], position[61] = 0.0, safe[61] + single(0.02)
    wanted = position[61].copy()
    undo(position, velocity, safe, mobility)
    assert crossings_of(position) == set()
    np.testing.assert_allclose(position[61], wanted, atol=1e-5)


def test_zones_do_not_sink_into_the_desk() -> None:
    """A zone that its vertices' motion would carry down stops where its lowest one rests."""
    safe, position = into_a_tangle()
    desk = float(safe[:, 2].min()) - 0.001
    position[:, 2] -= single(0.03)
    position[:, 2] = np.maximum(position[:, 2], single(desk))
    undo(position, np.zeros_like(safe), safe, np.ones(len(safe)), desk)
    assert crossings_of(position) == set() and position[:, 2].min() >= desk - 1e-6


def test_watched_edges_are_pushed_apart() -> None:
    """An edge that came through another one is pushed back to the side where it belongs."""
    position = np.array([[-1, 0, -0.1], [1, 0, -0.1], [0, -1, 0], [0, 1, 0]], dtype=single)
    pairs = allocate_edge_pairs(1)
    pairs.ends[0], pairs.side[0], pairs.length[0] = (0, 1, 2, 3), 1.0, 1
    heights = []
    for _ in range(12):
        collide_edges(position, pairs, single(0.2))
        heights.append(position[0, 2] - position[2, 2])
    # With the common normal (1, 0, 0) x (0, 1, 0) the right side is above.
    assert heights[-1] == pytest.approx(0.2, abs=1e-5) and np.all(np.diff(heights) > -1e-6)
    np.testing.assert_allclose(position.mean(axis=0), [0, 0, -0.05], atol=1e-6)


@pytest.mark.parametrize("seed", range(3))
def test_no_close_pair_is_missed(seed: int) -> None:
    """Every vertex and triangle closer than the reach, but far apart on the sheet, is listed."""
    positions, reach, apart = tangled(seed), 0.004, 0.0101
    patches = make_patches(VERTICES)
    segments = allocate_segments(len(patches.pairs))
    motion, candidates = allocate_motion(len(patches.cones)), allocate_candidates(50_000)
    sheet = (*VERTICES, *map(single, SPACING), single(apart))
    pairs = list_pairs(positions, MESH.triangles, sheet, single(reach), patches, segments, motion)
    used = 0
    for m in range(pairs):
        used = search_pair(
            positions,
            MESH.triangles,
            sheet,
            single(reach),
            single(0.002),
            m,
            patches,
            motion,
            candidates,
            segments,
            used,
        )
    listed = {(int(candidates.vertex[n]), int(candidates.triangle[n])) for n in range(used)}
    weights = np.random.default_rng(0).dirichlet([0.5, 0.5, 0.5], 200)
    grid = np.stack(np.divmod(np.arange(len(positions)), VERTICES[1]), -1) * SPACING
    close = 0
    for t, triangle in enumerate(MESH.triangles):
        cell = MESH.triangles[2 * (t // 2) : 2 * (t // 2) + 2].ravel()
        low, high = grid[cell].min(axis=0), grid[cell].max(axis=0)
        gaps = np.maximum(np.maximum(low - grid, grid - high), 0.0)
        far = np.linalg.norm(gaps, axis=1) > 1.05 * apart
        points = weights @ positions[triangle]
        distance = np.linalg.norm(positions[:, None] - points, axis=2).min(axis=1)
        for v in np.flatnonzero(far & (distance < reach)):
            close += 1
            assert (v, t) in listed
    assert close > 50


def test_every_corner_and_side_has_one_owner() -> None:
    """Of the triangles around each vertex and each side just one owns it; all own their inside."""
    owners = feature_owners(MESH.triangles)
    assert (owners >> 7 == 1).all()
    for parts in (((0,), (1,), (2,)), ((0, 1), (0, 2), (1, 2))):
        owned = [
            tuple(sorted(triangle[list(part)]))
            for triangle, bits in zip(MESH.triangles.tolist(), owners, strict=True)
            for triangle in [np.array(triangle)]
            for part in parts
            if bits >> sum(1 << k for k in part) & 1
        ]
        every = {
            tuple(sorted(triangle[list(part)])) for triangle in MESH.triangles for part in parts
        }
        assert len(owned) == len(set(owned)) and set(owned) == every
