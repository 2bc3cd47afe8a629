"""Keeps planned grasp and release points where the arms can go (paper, V-B)."""

from __future__ import annotations

import torch
from torch import Tensor

from emd_core.errors import InvalidInputError
from emd_core.frames import FieldOfView
from emd_core.reach_map import ReachMap
from emd_planner.arm_reach import ArmReach, PolygonReach, Region, cross, distance_to_polygon
from emd_planner.config import Polygon, ReachConfig
from emd_planner.reach_field import FieldReach

__all__ = ["ReachLoss", "depth_in_polygon", "distance_to_polygon", "normalised_polygon"]


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
    turns = cross(edges, edges.roll(-1, 0))
    # Turning left at every corner admits a star that winds twice; its angles exceed one turn.
    angles = torch.atan2(turns, (edges * edges.roll(-1, 0)).sum(-1)).sum()
    if (turns < -1e-6).any() or angles > 1.5 * 2.0 * torch.pi or _signed_area(corners) < 1e-6:
        raise InvalidInputError(
            f"a reach polygon must be convex with an area, got {polygon}; take its convex hull"
        )
    return corners


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
    depths = cross(edges, points[..., None, :] - corners) / lengths
    return depths.amin(-1).clamp_min(0.0)


class ReachLoss:
    """0 where both hands stay within reach, else how far out they are (V-B).

    The two hands of a manipulation go to different arms, in whichever of the two ways leaves less
    distance, or if arms must not cross, the hand at smaller y to the left arm. A hand that grasps
    nothing is not constrained.
    """

    def __init__(
        self,
        reach: ReachConfig | ReachMap,
        field_of_view: FieldOfView,
        device: torch.device,
        may_cross: bool = True,
    ) -> None:
        """Prepare the regions: polygons, or the samples of a map with arms "left" and "right".

        Raises:
            InvalidInputError: If a polygon is not convex, or the map lacks an arm.
        """
        self._may_cross = may_cross
        self._arms: list[ArmReach]
        if isinstance(reach, ReachMap):
            self._arms = [
                FieldReach(reach, arm, field_of_view, device) for arm in ("left", "right")
            ]
        else:
            self._arms = [
                PolygonReach(normalised_polygon(polygon, field_of_view).to(device))
                for polygon in (reach.left, reach.right)
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

    def assigned(
        self, manipulation: Tensor, used: Tensor
    ) -> tuple[float, tuple[tuple[Region, Region], tuple[Region, Region]]]:
        """Give the loss, and for each hand where its arm can grasp, and where it can release.

        Args:
            manipulation: Shape (6,), normalised.
            used: Which hands grasp cloth, boolean, shape (2,).
        """
        ways = self._both_ways(manipulation, used)
        crosses = bool(self._crosses(manipulation, used, *ways))
        left, right = (arm.regions(manipulation[4:]) for arm in self._arms)
        return float(ways[crosses]), (right, left) if crosses else (left, right)

    def _both_ways(self, manipulations: Tensor, used: Tensor) -> tuple[Tensor, Tensor]:
        """Sum the distances if the first hand goes to the left arm, and if to the right one."""
        grasps = manipulations[..., :4].unflatten(-1, (2, 2))
        left, right = (
            arm.excess(grasps, manipulations[..., None, 4:]) * used for arm in self._arms
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


def _signed_area(corners: Tensor) -> Tensor:
    return 0.5 * cross(corners, corners.roll(-1, 0)).sum()
