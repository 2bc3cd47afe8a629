"""Claims about a cloth that keeps its shape, and about the reference preset."""

import math

import numpy as np
import pytest

from emd_cloth_sim.cloth import Cloth
from emd_cloth_sim.config import ClothConfig
from emd_cloth_sim.manipulate import manipulate
from emd_cloth_sim.mesh import flat_positions
from emd_cloth_sim.presets import preset
from emd_core.errors import InvalidInputError
from emd_core.manipulation import Manipulation

SIDE = 21


def ridged(config: ClothConfig) -> np.ndarray:
    """A sheet with a ridge of 20 mm across its middle, resting on the desk beside it."""
    flat = flat_positions(config.vertices, config.side_lengths)
    flat[:, 2] = config.rest_height + 0.02 * np.exp(-((flat[:, 0] / 0.03) ** 2))
    return flat


def test_plastic_cloth_keeps_a_stiff_ridge() -> None:
    """A ridge that is its rest shape stands; in an elastic cloth of equal stiffness it sinks."""
    heights = {}
    for plastic in (True, False):
        config = ClothConfig(
            vertices=(SIDE, SIDE),
            membrane="springs",
            bending="hinges",
            bending_rigidity=2e-3,
            sharpest_fold=0.0,
            plastic=plastic,
            desk_friction=0.2,
        )
        cloth = Cloth.from_positions(ridged(config), config)
        cloth.advance(0.5)
        heights[plastic] = float(cloth.positions_in_table[:, 2].max())
    assert heights[True] > 0.018 and heights[False] < 0.009


def test_plastic_cloth_needs_a_rest_shape_that_can_change() -> None:
    """Plasticity without springs and hinges, and unknown models, are rejected."""
    for values in ({"plastic": True}, {"membrane": "chain"}, {"bending": "elbow"}):
        with pytest.raises(InvalidInputError):
            ClothConfig(**values)


def test_contacts_separate_gently() -> None:
    """Cloth that starts too low rises at the separation speed and is not thrown up."""
    cloth_preset = preset("reference", (SIDE, SIDE))
    config = cloth_preset.cloth
    flat = flat_positions(config.vertices, config.side_lengths)
    flat[:, 2] = config.rest_height - 0.001
    cloth = Cloth.from_positions(flat, config)
    highest = 0.0
    for _ in range(30):
        cloth.advance(0.005)
        highest = max(highest, float(cloth.positions_in_table[:, 2].max()))
    assert math.isclose(cloth.positions_in_table[:, 2].min(), config.rest_height, abs_tol=1e-4)
    assert highest < config.rest_height + 1e-3


def test_rigid_grip_takes_the_cloth_along_exactly() -> None:
    """Vertices in a rigid grip follow the hand to rounding error, and come to no harm."""
    config = preset("reference", (SIDE, SIDE)).cloth
    cloth = Cloth(config)
    hand = np.diag([1.0, -1.0, -1.0, 1.0])
    hand[:3, 3] = cloth.positions_in_table[0]
    before = cloth.positions_in_table[0]
    assert cloth.grasp(0, hand) == 1
    hand[:3, 3] += [0.05, 0.03, 0.04]
    cloth.move_hand(0, hand)
    cloth.advance(0.1)
    np.testing.assert_allclose(cloth.positions_in_table[0] - before, [0.05, 0.03, 0.04], atol=1e-9)


def test_reference_manipulation_ends_on_time_with_a_new_rest_shape() -> None:
    """The state is taken after the path's frames, and the next manipulation starts from it."""
    chosen = preset("reference", (SIDE, SIDE))
    cloth = Cloth(chosen.cloth)
    unit = chosen.path.half_extent
    points = np.array([[-0.7, -0.7], [np.nan, np.nan]]) * unit
    outcome = manipulate(cloth, Manipulation(points, np.array([0.8, 0.4]) * unit), chosen.path)
    assert outcome.held_counts[0] > 0 and outcome.diagnostics.finite
    assert outcome.settle_time == pytest.approx(chosen.path.frames_after * chosen.path.frame)
    assert outcome.diagnostics.stretch_p99 > 1.0
    cloth.take_rest_shape()
    assert cloth.check().stretch_p99 == pytest.approx(1.0)
