"""A manipulation tried on a simulated copy of the cloth."""

import asyncio
from dataclasses import replace

import numpy as np
import pytest
from fake_cell import HALF, observation

from emd_cloth_sim.config import ClothConfig
from emd_cloth_sim.mesh import flat_positions
from emd_console.goals import neat_goal
from emd_console.what_if import WhatIf, vertices
from emd_core.errors import CancelledError, InvalidInputError
from emd_core.manipulation import Manipulation
from emd_core.metrics import voxel_mse

CLOTH = ClothConfig()
FLAT = flat_positions(CLOTH.vertices, CLOTH.side_lengths)
IN_SIMULATION = replace(observation(), cloth_states=FLAT.astype(np.float32))


def turned(degrees: float, shift: tuple[float, float]) -> np.ndarray:
    """Points of a flat cloth that was turned and shifted."""
    angle = np.deg2rad(degrees)
    rotation = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
    return np.column_stack([FLAT[:, :2] @ rotation + shift, FLAT[:, 2]])


def test_a_half_fold_tried_out_is_about_the_neat_one() -> None:
    """In a process of its own, from the simulator's vertices."""
    grid = asyncio.run(WhatIf().outcome(IN_SIMULATION, HALF))
    goal = neat_goal("half").grid
    assert voxel_mse(grid, goal) < 0.3 * voxel_mse(IN_SIMULATION.grid, goal)


def test_nothing_grasped_is_said() -> None:
    """The simulation's own words come back."""
    beside = Manipulation(np.array([[-0.27, -0.27], [np.nan, np.nan]]), np.array([0.1, 0.0]))
    with pytest.raises(InvalidInputError, match="on the cloth"):
        asyncio.run(WhatIf().outcome(IN_SIMULATION, beside))


def test_a_simulation_can_be_stopped() -> None:
    """Its process is ended and who waits is told."""

    async def stop_it() -> None:
        what_if = WhatIf()
        task = asyncio.create_task(what_if.outcome(IN_SIMULATION, HALF))
        while what_if._process is None:
            await asyncio.sleep(0.01)
        process = what_if._process
        what_if.stop()
        with pytest.raises(CancelledError):
            await task
        assert process.returncode == -9

    asyncio.run(stop_it())


@pytest.mark.parametrize("degrees", [0.0, 12.0, 45.0, 80.0])
def test_a_flat_cloth_is_laid_where_it_is_seen(degrees) -> None:
    """Its corners, in whatever order, for a cloth without a simulator's word."""
    seen = replace(observation(), points_in_table=turned(degrees, (0.03, -0.05)))
    found = vertices(seen)[:, :2]
    x, y = CLOTH.vertices
    corners = [0, y - 1, (x - 1) * y, x * y - 1]
    wanted = turned(degrees, (0.03, -0.05))[corners, :2]
    gaps = np.linalg.norm(found[corners][:, None] - wanted[None], axis=-1)
    assert gaps.min(axis=1).max() < 2e-3 and gaps.min(axis=0).max() < 2e-3
    edges = np.linalg.norm(np.diff(found.reshape(x, y, 2), axis=0), axis=-1)
    assert np.allclose(edges, CLOTH.side_lengths[0] / (x - 1), atol=1e-6)


def test_a_folded_cloth_is_refused_where_its_layers_are_unknown() -> None:
    """With the remedy."""
    half = FLAT[FLAT[:, 0] > 0]
    with pytest.raises(InvalidInputError, match="spread it out"):
        vertices(replace(observation(), points_in_table=half))
    with pytest.raises(InvalidInputError, match="no cloth"):
        vertices(replace(observation(), points_in_table=np.zeros((0, 3))))
