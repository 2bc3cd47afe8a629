"""Keeps planned grasp and release points where the arms can go (paper, V-B)."""

from __future__ import annotations

import torch
from torch import Tensor

from emd_core.errors import InvalidInputError
from emd_core.frames import FieldOfView
from emd_planner.config import Polygon, ReachConfig


def normalised_polygon(polygon: Polygon, field_of_view: FieldOfView) -> Tensor:
    """Turn corners in metres (table frame) into normalised ones, counter-clockwise, shape (N, 2).

    Raises:
        InvalidInputError: If these are not at least three corners of a convex polygon.
    """
    corners = torch.tensor(polygon, dtype=torch.float32)
    if corners.ndim != 2 or corners.shape[0] < 3 or corners.shape[1] != 2:
        raise InvalidInputError(f"a reach polygon needs corners (N >= 3, 2), got {polygon}")
    if not corners.isfinite().all():
        raise InvalidInputError(f"a reach polygon's corners must be finite, got {polygon}")
    corners = corners / field_of_view.half_extent
    if _signed_area(corners) < 0.0:
        corners = corners.flip(0)
    edges = corners.roll(-1, 0) - corners
    turns = _cross(edges, edges.roll(-1, 0))
    # Turning left at every corner admits a star that winds twice; its angles exceed one turn.
    angles = torch.atan2(turns, (edges * edges.roll(-1, 0)).sum(-1)).sum()
    if (turns < -1e-6).any() or angles > 1.5 * 2.0 * torch.pi or _signed_area(corners) < 1e-6:
        raise InvalidInputError(
            f"a reach polygon must be convex with an area, got {polygon}; take its convex hull"
        )
    return corners


def distance_to_polygon(points: Tensor, corners: Tensor) -> Tensor:
    """Distance to a convex region, 0 inside, with a unit gradient outside.

    Args:
        points: Shape (..., 2).
        corners: Counter-clockwise, shape (N, 2), same unit.

    Returns:
        Shape (...).
    """
    edges = corners.roll(-1, 0) - corners
    relative = points[..., None, :] - corners
    along = ((relative * edges).sum(-1) / (edges * edges).sum(-1).clamp_min(1e-12)).clamp(0, 1)
    squared = (relative - along[..., None] * edges).square().sum(-1).amin(-1)
    inside = (_cross(edges, relative) >= 0.0).all(-1)
    # The root is taken of 1 inside, where its gradient would be infinite on the border.
    distance = torch.where(inside, torch.ones_like(squared), squared).clamp_min(1e-16).sqrt()
    return torch.where(inside, torch.zeros_like(distance), distance)


def depth_in_polygon(points: Tensor, corners: Tensor) -> Tensor:
    """Distance to the outside of a convex region, 0 outside it.

    Args:
        points: Shape (..., 2).
        corners: Counter-clockwise, shape (N, 2), same unit.

    Returns:
        Shape (...).
    """
    edges = corners.roll(-1, 0) - corners
    lengths = edges.square().sum(-1).clamp_min(1e-12).sqrt()
    depths = _cross(edges, points[..., None, :] - corners) / lengths
    return depths.amin(-1).clamp_min(0.0)


class ReachLoss:
    """0 where both hands stay within reach, else how far out they are (V-B).

    The two hands of a manipulation go to different arms, in whichever of the two ways leaves less
    distance, or if arms must not cross, the hand at smaller y to the left arm. A hand that grasps
    nothing is not constrained.
    """

    def __init__(
        self,
        config: ReachConfig,
        field_of_view: FieldOfView,
        device: torch.device,
        may_cross: bool = True,
    ) -> None:
        """Prepare the regions.

        Raises:
            InvalidInputError: If a polygon is not convex.
        """
        self._may_cross = may_cross
        self._regions = [
            normalised_polygon(polygon, field_of_view).to(device)
            for polygon in (config.left, config.right)
        ]

    def __call__(self, manipulations: Tensor, used: Tensor) -> Tensor:
        """Sum the distances of grasp and release points from their arms' regions.

        Args:
            manipulations: Shape (..., 6), normalised.
            used: Which hands grasp cloth, boolean, shape (..., 2).

        Returns:
            Normalised units, shape (...).
        """
        straight, crossed = self._both_ways(manipulations, used)
        return torch.where(
            self._crosses(manipulations, used, straight, crossed), crossed, straight
        )

    def regions_of(self, manipulation: Tensor, used: Tensor) -> tuple[Tensor, Tensor]:
        """Give the regions, corners (N, 2), of the arms to which the two hands go.

        Args:
            manipulation: Shape (6,), normalised.
            used: Which hands grasp cloth, boolean, shape (2,).
        """
        ways = self._both_ways(manipulation, used)
        left, right = self._regions
        return (right, left) if self._crosses(manipulation, used, *ways) else (left, right)

    def _both_ways(self, manipulations: Tensor, used: Tensor) -> tuple[Tensor, Tensor]:
        """Sum the distances if the first hand goes to the left arm, and if to the right one."""
        grasps = manipulations[..., :4].unflatten(-1, (2, 2))
        releases = grasps + manipulations[..., None, 4:]
        left, right = (
            (distance_to_polygon(grasps, region) + distance_to_polygon(releases, region)) * used
            for region in self._regions
        )
        return left[..., 0] + right[..., 1], right[..., 0] + left[..., 1]

    def _crosses(
        self, manipulations: Tensor, used: Tensor, straight: Tensor, crossed: Tensor
    ) -> Tensor:
        """Whether the first hand goes to the right arm."""
        nearer = crossed < straight
        if self._may_cross:
            return nearer
        ordered = manipulations[..., 1] > manipulations[..., 3]
        return torch.where(used.all(-1), ordered, nearer)


def _cross(a: Tensor, b: Tensor) -> Tensor:
    return a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]


def _signed_area(corners: Tensor) -> Tensor:
    return 0.5 * _cross(corners, corners.roll(-1, 0)).sum()
