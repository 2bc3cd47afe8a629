"""How far links can move against each other while joints turn: what makes a path check complete.

Two configurations with clearances c0 and c1 prove a path between them free if no point of one link
can move by c0 + c1 against the other on the way: going on from the first, the distance falls at
most by what is travelled, and going back from the second likewise (conservative advancement).
"""

from __future__ import annotations

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from emd_core.frames import FloatArray


class MotionBound:
    """Bounds the relative travel of pairs of geometries by the travel of the joints."""

    def __init__(self, model: pin.Model, geometry: pin.GeometryModel) -> None:
        """Measure the levers of all collision pairs of `geometry`."""
        levers = np.stack([_levers(model, item) for item in geometry.geometryObjects])
        pairs = [(pair.first, pair.second) for pair in geometry.collisionPairs]
        first, second = np.array(pairs, dtype=int).reshape(-1, 2).T
        # A joint that carries both links does not move them against each other.
        both = (levers[first] > 0.0) & (levers[second] > 0.0)
        self._levers = np.where(both, 0.0, levers[first] + levers[second])

    @property
    def largest(self) -> float:
        """The most that a pair moves while every joint moves by 1 radian or metre, metres."""
        return float(self._levers.sum(axis=1).max(initial=0.0))

    def travel(self, turned: FloatArray, pairs: NDArray[np.intp] | None = None) -> FloatArray:
        """Bound how far the links of each pair move against each other.

        Args:
            turned: How far each joint turns, to and fro added up, shape (..., nq), radians or
                metres.
            pairs: Indices of the pairs that are asked for; all if None.

        Returns:
            Metres, shape (..., P).
        """
        levers = self._levers if pairs is None else self._levers[pairs]
        # Not turned @ levers.T, which BLAS would spread over all cores.
        travel: FloatArray = (levers @ turned[..., None])[..., 0]
        return travel


def _levers(model: pin.Model, item: pin.GeometryObject) -> FloatArray:
    """Bound the travel of a geometry's points per unit of each joint, shape (nq,).

    A turning joint moves a point by its distance from the axis at most: the lengths of the links
    up to the geometry and the geometry's own extent. A sliding joint moves it by 1.
    """
    levers = np.zeros(model.nq)
    item.geometry.computeLocalAABB()
    centre = item.placement.act(np.asarray(item.geometry.aabb_center))
    reach = float(np.linalg.norm(centre) + item.geometry.aabb_radius)
    joint = item.parentJoint
    while joint != 0:
        slides = model.joints[joint].shortname().startswith("JointModelP")
        levers[model.joints[joint].idx_q] = 1.0 if slides else reach
        extent = _slide(model, joint) if slides else 0.0
        reach += float(np.linalg.norm(model.jointPlacements[joint].translation)) + extent
        joint = model.parents[joint]
    return levers


def _slide(model: pin.Model, joint: int) -> float:
    """Give how far a sliding joint can be from its zero."""
    column = model.joints[joint].idx_q
    ends = (model.lowerPositionLimit[column], model.upperPositionLimit[column])
    return float(np.abs(ends).max())
