"""Points and silhouettes."""

from __future__ import annotations

import torch

from emd_planner.silhouette import (
    columns_of,
    dilate,
    near_cloth,
    onto_silhouette,
    outside_cloth,
)


def _middle(*columns: int) -> torch.Tensor:
    return (torch.tensor(columns) + 0.5) / 16.0 - 1.0


def test_points_go_to_the_nearest_column_and_off_the_outer_halves() -> None:
    """Beside the cloth: to a column's middle; at its edge: inwards; inside: not at all."""
    cloth = torch.zeros(32, 32, dtype=torch.bool)
    cloth[10:20, 10:20] = True
    beside = _middle(22, 15)
    outer = _middle(19, 15) + torch.tensor([0.02, 0.02])
    corner = _middle(10, 19) + torch.tensor([-0.02, 0.02])
    inner_half = _middle(19, 15) - torch.tensor([0.02, 0.0])
    inside = _middle(14, 14) + torch.tensor([0.02, 0.02])
    moved = onto_silhouette(torch.stack([beside, outer, corner, inner_half, inside]), cloth)
    torch.testing.assert_close(moved[0], _middle(19, 15))
    torch.testing.assert_close(moved[1], _middle(19, 15) + torch.tensor([0.0, 0.02]))
    torch.testing.assert_close(moved[2], _middle(10, 19))
    assert torch.equal(moved[3], inner_half) and torch.equal(moved[4], inside)


def test_edges_are_those_of_wrapped_cloth() -> None:
    """A cloth that wraps has no edge where the grid ends; without cloth points stay."""
    cloth = torch.zeros(32, 32, dtype=torch.bool)
    cloth[28:, 10:20] = True
    cloth[:4, 10:20] = True
    last = _middle(31, 15) + torch.tensor([0.02, 0.0])
    assert torch.equal(onto_silhouette(last[None], cloth)[0], last)
    points = torch.rand(20, 2) * 2.0 - 1.0
    assert torch.equal(onto_silhouette(points, torch.zeros_like(cloth)), points)
    columns = columns_of(onto_silhouette(points, cloth), 32)
    assert cloth[columns[:, 0], columns[:, 1]].all()


def test_near_cloth_is_on_the_widened_silhouette():
    """For points anywhere, beyond the edge at which grids wrap too."""
    generator = torch.Generator().manual_seed(0)
    cloth = torch.rand(6, 2, 32, 32, generator=generator) < 0.02
    points = 3.0 * torch.rand(6, 2, 5, 2, generator=generator) - 1.5
    for voxels in (0, 1, 2):
        wide = dilate(cloth, voxels)
        wanted = [~outside_cloth(points[..., i, :], wide) for i in range(5)]
        found = near_cloth(points, cloth, voxels)
        assert torch.equal(found, torch.stack(wanted, -1))
        assert found.any() and not found.all()
