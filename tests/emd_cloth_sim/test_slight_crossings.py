"""Parting layers that rounding made cross."""

from __future__ import annotations

import numpy as np
import pytest

from emd_cloth_sim.cloth import Cloth
from emd_cloth_sim.config import ClothConfig
from emd_cloth_sim.diagnostics import list_crossings
from emd_cloth_sim.mesh import build_mesh
from emd_cloth_sim.slight_crossings import part_slight_crossings

CONFIG = ClothConfig(vertices=(21, 21))
MESH = build_mesh(CONFIG.vertices, CONFIG.spacing)


def folded(depth: float) -> np.ndarray:
    """A sheet folded in half along x whose upper layer dips through the lower one by `depth`."""
    positions = Cloth(CONFIG).positions_in_table
    upper = positions[:, 0] > 0.01
    beyond = positions[upper, 0] - 0.01
    positions[upper, 0] = 0.013 - beyond
    dips = np.cos(positions[upper, 1] * 40.0) * np.clip(beyond / 0.05, 0.0, 1.0)
    positions[upper, 2] += 0.004 - (0.004 + depth) * np.maximum(dips, 0.0)
    return positions


@pytest.mark.parametrize("depth", [2e-5, 2e-4])
def test_layers_that_barely_cross_are_parted(depth: float) -> None:
    """By moves of about the depth; nothing else moves."""
    positions = folded(depth)
    assert len(list_crossings(positions, MESH, CONFIG.vertices)) > 3
    parted = part_slight_crossings(positions, MESH, CONFIG.vertices)
    assert len(list_crossings(parted, MESH, CONFIG.vertices)) == 0
    ways = np.linalg.norm(parted - positions, axis=1)
    assert 0.0 < ways.max() < 2.0 * depth + 2e-4
    assert (ways > 1e-7).mean() < 0.6


def test_what_crosses_deeply_is_left_alone() -> None:
    """It is no matter of rounding."""
    positions = folded(0.02)
    parted = part_slight_crossings(positions, MESH, CONFIG.vertices, most=1e-4)
    assert np.abs(parted - positions).max() < 1e-2
    assert len(list_crossings(parted, MESH, CONFIG.vertices)) > 0


def test_cloth_without_crossings_stays() -> None:
    """To the digits of single precision."""
    positions = Cloth(CONFIG).positions_in_table
    np.testing.assert_array_equal(
        part_slight_crossings(positions, MESH, CONFIG.vertices), positions
    )
