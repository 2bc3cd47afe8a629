"""Where one arm can grasp and release, as the reach loss and the projection into reach need it."""

from __future__ import annotations

from abc import ABC, abstractmethod

import numpy as np
import torch
from torch import Tensor

from emd_planner.silhouette import column_centres

_INWARD = 1e-3  # of the way from the border to a polygon's middle, against rounding


class Region(ABC):
    """A part of the desk, normalised coordinates."""

    @abstractmethod
    def distance(self, points: Tensor) -> Tensor:
        """Give the distance (...) of points (..., 2) from the region, 0 inside."""

    @abstractmethod
    def columns(self, count: int) -> Tensor:
        """Tell which columns of a grid have their middles inside: boolean (count, count)."""

    @abstractmethod
    def nearest(self, point: Tensor) -> Tensor:
        """Give the nearest place (2,) in the region, the point itself if it is inside."""


class ArmReach(ABC):
    """The reach of one arm, which may depend on the direction in which its hand goes."""

    @abstractmethod
    def excess(self, grasps: Tensor, moves: Tensor) -> Tensor:
        """Sum the distances of grasps and releases from the reach.

        Args:
            grasps: Shape (..., 2), normalised.
            moves: Displacements, a shape that broadcasts with it.

        Returns:
            Normalised units, shape (...).
        """

    @abstractmethod
    def regions(self, move: Tensor) -> tuple[Region, Region]:
        """Give where a hand that makes a displacement (2,) can grasp, and where release."""


class PolygonReach(ArmReach, Region):
    """One convex polygon for grasps and releases, whatever the direction."""

    def __init__(self, corners: Tensor) -> None:
        """Keep the corners, counter-clockwise, shape (N, 2), normalised."""
        self._corners = corners
        self._edges = corners.roll(-1, 0) - corners
        self._columns: dict[int, Tensor] = {}
        self._corners_array, self._edges_array = corners.cpu().numpy(), self._edges.cpu().numpy()

    def excess(self, grasps: Tensor, moves: Tensor) -> Tensor:
        """Sum the distances of grasps and releases from the polygon."""
        return self.distance(grasps) + self.distance(grasps + moves)

    def regions(self, move: Tensor) -> tuple[Region, Region]:
        """Give the polygon twice."""
        return self, self

    def distance(self, points: Tensor) -> Tensor:
        """Give the distance (...) of points (..., 2), with a unit gradient outside."""
        return distance_to_polygon(points, self._corners)

    def columns(self, count: int) -> Tensor:
        """Tell which columns have their middles inside; worked out once for a count."""
        if count not in self._columns:
            relative = column_middles(count, self._corners.device)[..., None, :] - self._corners
            self._columns[count] = (cross(self._edges, relative) >= 0.0).all(-1)
        return self._columns[count]

    def nearest(self, point: Tensor) -> Tensor:
        """Give the nearest place (2,), a little inside the border if the point is beyond it."""
        # In numpy: a projection takes many of these, each too little for a tensor's overhead.
        corners, edges = self._corners_array, self._edges_array
        place = point.cpu().numpy()
        relative = place - corners
        if (edges[:, 0] * relative[:, 1] - edges[:, 1] * relative[:, 0] >= 0.0).all():
            return point
        along = (relative * edges).sum(-1) / np.maximum((edges * edges).sum(-1), 1e-12)
        places = corners + along.clip(0.0, 1.0)[:, None] * edges
        nearest = places[np.square(places - place).sum(-1).argmin()]
        return torch.from_numpy(nearest + _INWARD * (corners.mean(0) - nearest)).to(point)


def column_middles(count: int, device: torch.device) -> Tensor:
    """Normalised places of a grid's columns, shape (count, count, 2)."""
    axis = column_centres(count, device)
    return torch.stack(torch.meshgrid(axis, axis, indexing="ij"), -1)


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
    inside = (cross(edges, relative) >= 0.0).all(-1)
    # The root is taken of 1 inside, where its gradient would be infinite on the border.
    distance = torch.where(inside, torch.ones_like(squared), squared).clamp_min(1e-16).sqrt()
    return torch.where(inside, torch.zeros_like(distance), distance)


def cross(a: Tensor, b: Tensor) -> Tensor:
    """Give the z of the cross product of vectors (..., 2)."""
    return a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]
