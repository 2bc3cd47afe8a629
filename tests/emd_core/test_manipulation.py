"""Manipulations: what is refused, and the network's six values."""

import numpy as np
import pytest

from emd_core.errors import InvalidInputError
from emd_core.frames import FieldOfView
from emd_core.manipulation import Manipulation

NAN = float("nan")


def test_to_network_and_back() -> None:
    """The six normalised values carry the whole manipulation."""
    fov = FieldOfView()
    made = Manipulation(np.array([[-0.2, 0.1], [NAN, NAN]]), np.array([0.4, 0.0]))
    again = Manipulation.from_network(made.to_network(fov), made.used, fov)
    assert made.used == (True, False)
    assert np.allclose(made.to_network(fov)[[0, 1, 4, 5]], [-0.7, 0.35, 1.4, 0.0])
    assert np.allclose(again.grasp_points_in_table, made.grasp_points_in_table, equal_nan=True)
    assert np.allclose(again.displacement_in_table, made.displacement_in_table)


@pytest.mark.parametrize(
    ("points", "displacement"),
    [
        ([[NAN, NAN], [NAN, NAN]], [0.1, 0.0]),
        ([[0.0, NAN], [0.0, 0.0]], [0.1, 0.0]),
        ([[0.0, 0.0], [0.0, 0.0]], [NAN, 0.0]),
        ([[0.0, 0.0], [np.inf, 0.0]], [0.1, 0.0]),
        ([[0.0, 0.0]], [0.1, 0.0]),
    ],
)
def test_bad_values_are_refused(points, displacement) -> None:
    """NaN in a used value, no used point, or a wrong shape is the caller's error."""
    with pytest.raises(InvalidInputError):
        Manipulation(np.array(points), np.array(displacement))
