"""Tests of means over squares: against a plain loop."""

import numpy as np

from emd_perception.square_means import SquareMeans

SIDE = 0.01


def some_points() -> tuple[np.ndarray, np.ndarray]:
    """Points on both sides of the origin and their colours."""
    rng = np.random.default_rng(3)
    points = rng.uniform(-0.06, 0.05, (400, 3)) * [1.0, 1.0, 0.2]
    return points, rng.integers(0, 256, (400, 3)).astype(np.uint8)


def test_means_counts_and_spreads_are_those_of_each_squares_points() -> None:
    """Every square that holds a point is listed once, with what NumPy says of its points."""
    points, values = some_points()
    squares = SquareMeans.of(points, values, SIDE)
    place = np.floor(points[:, :2] / SIDE).astype(int)
    place -= place.min(axis=0)
    assert len(squares) == len(np.unique(place, axis=0))
    for index, mean, value, count, spread in zip(
        squares.index, squares.points, squares.values, squares.counts, squares.spread, strict=True
    ):
        inside = (place == index).all(axis=1)
        assert count == inside.sum()
        np.testing.assert_allclose(mean, points[inside].mean(axis=0), atol=1e-12)
        np.testing.assert_allclose(value, values[inside].mean(axis=0))
        np.testing.assert_allclose(spread, points[inside, 2].std(), atol=1e-7)


def test_squares_beside_are_counted_by_their_height() -> None:
    """Only neighbours within the difference count, diagonal ones too, and no square itself."""
    points, values = some_points()
    squares = SquareMeans.of(points, values, SIDE)
    heights = squares.points[:, 2]
    for index, height, count in zip(
        squares.index, heights, squares.alike_beside(0.004), strict=True
    ):
        beside = np.abs(squares.index - index).max(axis=1) == 1
        assert count == (beside & (np.abs(heights - height) <= 0.004)).sum()
