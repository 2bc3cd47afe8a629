"""Claims about the configurations of the simulated cloth."""

import pytest

from emd_cloth_sim.config import ClothConfig, HandPathConfig
from emd_core.errors import InvalidInputError


@pytest.mark.parametrize(
    "values",
    [
        {"thickness": 0.0},
        {"side_lengths": (0.4, -0.4)},
        {"vertices": (4, 41)},
        {"desk_friction": -0.1},
        {"damping": float("nan")},
        {"gravity": (0.0, 0.0, float("inf"))},
        {"substeps": 0},
        {"thickness": 0.2},
        {"vertices": (41, 200)},
        {"max_speed": 20.0},
    ],
)
def test_bad_cloth_is_rejected(values: dict) -> None:
    """A value out of range, or values that do not fit each other, raise InvalidInputError."""
    with pytest.raises(InvalidInputError):
        ClothConfig(**values)


@pytest.mark.parametrize(
    "values", [{"lift_height": 0.0}, {"rise_ratio": 0.6}, {"settle_time_limit": -1.0}]
)
def test_bad_path_is_rejected(values: dict) -> None:
    """A path that drags or never moves raises InvalidInputError."""
    with pytest.raises(InvalidInputError):
        HandPathConfig(**values)


def test_finer_mesh_gets_more_substeps() -> None:
    """Substeps grow with the vertices of the longer side, so that stretch does not."""
    assert ClothConfig(vertices=(41, 81)).mesh_substeps == 16
    assert ClothConfig(vertices=(101, 41)).mesh_substeps == 20
    assert ClothConfig(vertices=(21, 21)).mesh_substeps == ClothConfig().mesh_substeps


def test_hand_reaches_a_vertex_wherever_it_closes() -> None:
    """The reach covers the middle of a cell, however coarse the mesh is."""
    for side in (5, 21, 41):
        config = ClothConfig(vertices=(side, side))
        assert config.effective_grasp_radius > 0.5 * 2**0.5 * max(config.spacing)
