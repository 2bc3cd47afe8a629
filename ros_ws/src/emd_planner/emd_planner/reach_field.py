"""A sampled reach map as a smooth field of distances (ours, in place of V-B's rough area)."""

from __future__ import annotations

import math

import numpy as np
import torch
from scipy.ndimage import distance_transform_edt
from torch import Tensor

from emd_core.errors import InvalidInputError
from emd_core.frames import FieldOfView
from emd_core.reach_map import ReachMap
from emd_core.voxel_grid import BoolArray
from emd_planner.arm_reach import ArmReach, Region, column_middles


class FieldReach(ArmReach):
    """The reach of one arm by the direction of its hand, which folds along its displacement.

    A hand comes to a hem from outside, so a fold moves on in the direction in which the hand came;
    that is the direction that is looked up. Between samples of place and direction the distances
    are interpolated linearly, so the field has a gradient wherever it is not 0.
    """

    def __init__(
        self, reach_map: ReachMap, arm: str, field_of_view: FieldOfView, device: torch.device
    ) -> None:
        """Measure the distances from the samples of one arm that are within reach.

        Raises:
            InvalidInputError: If the map lacks the arm, or the arm reaches nothing.
        """
        if arm not in reach_map.arms:
            raise InvalidInputError(f"a reach map of arm {arm} is wanted, got {reach_map.arms}")
        index, unit = reach_map.arms.index(arm), field_of_view.half_extent
        self.start = float(reach_map.axis[0]) / unit
        self.step = reach_map.step / unit
        self._grasp, self._release = (
            torch.tensor(_distances(arm, masks[index], self.step), device=device)
            for masks in (reach_map.grasp, reach_map.release)
        )

    def excess(self, grasps: Tensor, moves: Tensor) -> Tensor:
        """Sum the distances of grasps and releases from where a hand of that direction can be."""
        yaws = torch.atan2(moves[..., 1], moves[..., 0]).expand(grasps.shape[:-1])
        return self.look_up(self._grasp, grasps, yaws) + self.look_up(
            self._release, grasps + moves, yaws
        )

    def regions(self, move: Tensor) -> tuple[Region, Region]:
        """Give where a hand that makes a displacement (2,) can grasp, and where release."""
        yaw = torch.atan2(move[1], move[0])
        return _FieldRegion(self, self._grasp, yaw), _FieldRegion(self, self._release, yaw)

    def look_up(self, field: Tensor, points: Tensor, yaws: Tensor) -> Tensor:
        """Interpolate a field (K, X, Y) at points (..., 2) and yaws (...); (...)."""
        count, size = field.shape[0], field.shape[1]
        place = (points - self.start) / self.step
        clamped = place.clamp(0.0, size - 1.0)
        beyond = (place - clamped).square().sum(-1)
        # The root of 0 has no gradient.
        outside = torch.where(beyond > 0.0, beyond.clamp_min(1e-16).sqrt(), 0.0) * self.step
        low = clamped.detach().floor().clamp(0, size - 2).long()
        u, v = (clamped - low).unbind(-1)
        turn = (yaws / (2.0 * math.pi) * count) % count
        before = turn.detach().floor().long() % count
        w = turn - turn.detach().floor()
        i, j = low.unbind(-1)

        def plane(k: Tensor) -> Tensor:
            near = field[k, i, j] * (1 - v) + field[k, i, j + 1] * v
            far = field[k, i + 1, j] * (1 - v) + field[k, i + 1, j + 1] * v
            return near * (1 - u) + far * u

        return plane(before) * (1 - w) + plane((before + 1) % count) * w + outside


class _FieldRegion(Region):
    """A field's zero set for one direction."""

    def __init__(self, reach: FieldReach, field: Tensor, yaw: Tensor) -> None:
        self._reach, self._field, self._yaw = reach, field, yaw

    def distance(self, points: Tensor) -> Tensor:
        return self._reach.look_up(self._field, points, self._yaw.expand(points.shape[:-1]))

    def columns(self, count: int) -> Tensor:
        return self.distance(column_middles(count, self._field.device)) == 0.0

    def nearest(self, point: Tensor) -> Tensor:
        """Give the point, or the nearest sample within reach; the point if there is none."""
        if self.distance(point) == 0.0:
            return point
        axis = self._reach.start + self._reach.step * torch.arange(
            self._field.shape[1], device=point.device, dtype=point.dtype
        )
        places = torch.stack(torch.meshgrid(axis, axis, indexing="ij"), -1).flatten(0, 1)
        reached = places[self.distance(places) <= 1e-6]
        if len(reached) == 0:
            return point
        return reached[(reached - point).square().sum(-1).argmin()]


def _distances(arm: str, masks: BoolArray, step: float) -> np.ndarray:
    """Give the distances (K, X, Y) from the nearest sample within reach, for each direction."""
    if not masks.any():
        raise InvalidInputError(f"the reach map says that the {arm} arm reaches nothing")
    farthest = step * math.hypot(*masks.shape[1:])
    fields = [
        distance_transform_edt(~mask) * step if mask.any() else np.full(mask.shape, farthest)
        for mask in masks
    ]
    return np.array(fields, dtype=np.float32)
