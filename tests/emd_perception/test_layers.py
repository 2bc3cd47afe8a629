"""Tests of counting layers by height."""

import numpy as np
import pytest

from emd_core.errors import InvalidInputError
from emd_core.frames import FieldOfView
from emd_perception.layers import count_layers

FIELD_OF_VIEW = FieldOfView()


def surface(heights: np.ndarray) -> np.ndarray:
    """Sixteen noisy points in each column at the heights given (X, Y), metres; NaN for none."""
    side = FIELD_OF_VIEW.resolution[0]
    index = np.repeat(np.argwhere(np.isfinite(heights)), 16, axis=0)
    rng = np.random.default_rng(0)
    xy = (index + rng.random(index.shape)) * side - FIELD_OF_VIEW.half_extent
    z = heights[tuple(index.T)] + rng.normal(0.0, 0.0008, len(index))
    return np.column_stack([xy, z])


@pytest.mark.parametrize("layers", [1, 2, 4])
def test_layers_are_told_by_height_and_gaping_creases_are_not_counted(layers: int) -> None:
    """3 mm a layer; along one side a crease stands a layer and a half too high."""
    heights = np.full((32, 32), np.nan)
    heights[8:20, 6:26] = 0.003 * layers
    heights[8, 6:26] += 0.0045
    told = count_layers(surface(heights), 0.003)
    assert (told[8:20, 6:26] == layers).all()
    assert (told[np.isnan(heights)] == 0).all()


def test_areas_of_different_layers_keep_their_border() -> None:
    """One layer beside two: no column beyond the border is outvoted."""
    heights = np.full((32, 32), np.nan)
    heights[6:16, 6:26], heights[16:26, 6:26] = 0.003, 0.006
    told = count_layers(surface(heights), 0.003)
    assert (told[6:16, 6:26] == 1).all()
    assert (told[16:26, 6:26] == 2).all()


@pytest.mark.parametrize("thickness", [0.0, -0.003, float("nan")])
def test_a_thickness_that_is_none_is_refused(thickness: float) -> None:
    """The error says what is wanted."""
    with pytest.raises(InvalidInputError, match="thickness"):
        count_layers(np.zeros((1, 3)), thickness)
