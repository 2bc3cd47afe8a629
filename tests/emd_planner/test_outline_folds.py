"""Claims about folds that a cloth's outline suggests."""

from __future__ import annotations

import pytest
import torch

from emd_planner.outline_folds import outline_folds
from emd_planner.silhouette import columns_of


def rectangle(x: slice, y: slice) -> torch.Tensor:
    """A silhouette of 32 x 32 columns."""
    silhouette = torch.zeros(32, 32, dtype=torch.bool)
    silhouette[x, y] = True
    return silhouette


def test_sides_and_corners_are_carried_across() -> None:
    """Of a rectangle: corners are grasped, and land on corners, sides, thirds or the middle."""
    silhouette = rectangle(slice(6, 26), slice(10, 22))
    folds = outline_folds(silhouette)
    single, double = folds[:8], folds[8:]
    assert single[:, 2:4].isnan().all() and not double.isnan().any()
    columns = {tuple(c) for c in columns_of(folds[:, :2], 32).tolist()}
    assert columns == {(6, 10), (6, 21), (25, 10), (25, 21)}
    width, height = 19 / 16, 11 / 16
    lengths = double[:, 4:].norm(dim=1)
    wanted = torch.tensor([share * side for share in (1, 2 / 3, 0.5) for side in (width, height)])
    found = lengths.unique(sorted=True)
    torch.testing.assert_close(found.sort().values, wanted.sort().values, atol=1e-4, rtol=0.0)
    for fold in double:  # both hands at one side, which is at right angles to the way
        assert float((fold[2:4] - fold[:2]) @ fold[4:]) == pytest.approx(0.0, abs=1e-5)
    released = columns_of(single[:4, :2] + single[:4, 4:], 32)
    assert {tuple(c) for c in released.tolist()} == columns


def test_a_cloth_across_the_rim_is_one_cloth() -> None:
    """Shifted so that it wraps, a silhouette suggests the same folds, shifted."""
    silhouette = rectangle(slice(4, 20), slice(3, 13))
    wrapped = silhouette.roll((-10, 22), dims=(0, 1))
    plain, moved = outline_folds(silhouette), outline_folds(wrapped)
    shift = torch.tensor([-10.0, 22.0]) / 16.0
    places = {tuple(c) for c in columns_of(plain[:, :2] + shift, 32).tolist()}
    assert places == {tuple(c) for c in columns_of(moved[:, :2], 32).tolist()}
    torch.testing.assert_close(
        plain[:, 4:].norm(dim=1).sort().values, moved[:, 4:].norm(dim=1).sort().values
    )


def test_without_cloth_there_are_none() -> None:
    """And no error."""
    assert outline_folds(torch.zeros(32, 32, dtype=torch.bool)).shape == (0, 6)
