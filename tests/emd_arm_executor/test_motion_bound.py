"""How far links can move against each other, on a small arm whose levers are known."""

from __future__ import annotations

import coal
import numpy as np
import pinocchio as pin
import pytest

from emd_arm_executor.motion_bound import MotionBound

# A column that turns (z), an arm of 0.5 m on it that turns (z), and a drawer at its end (x).
LENGTH, RADIUS, DRAWER = 0.5, 0.05, 0.2


def _arm() -> tuple[pin.Model, pin.GeometryModel]:
    model = pin.Model()
    offset = pin.SE3(np.eye(3), np.array([LENGTH, 0.0, 0.0]))
    first = model.addJoint(0, pin.JointModelRZ(), pin.SE3.Identity(), "column")
    second = model.addJoint(first, pin.JointModelRZ(), offset, "arm")
    third = model.addJoint(second, pin.JointModelPX(), offset, "drawer")
    model.lowerPositionLimit = np.array([-np.pi, -np.pi, 0.0])
    model.upperPositionLimit = np.array([np.pi, np.pi, DRAWER])
    geometry = pin.GeometryModel()
    for name, joint in (("ground", 0), ("elbow", second), ("hand", third)):
        ball = pin.GeometryObject(name, joint, 0, pin.SE3.Identity(), coal.Sphere(RADIUS))
        geometry.addGeometryObject(ball)
    for pair in ((0, 1), (0, 2), (1, 2)):
        geometry.addCollisionPair(pin.CollisionPair(*pair))
    return model, geometry


def test_levers_are_the_lengths_up_to_each_link() -> None:
    """A joint moves what it carries by the lengths beyond it; nothing that it does not part."""
    bound = MotionBound(*_arm())
    # The sphere's box has half a diagonal of sqrt(3) radii, no more.
    extent = bound.travel(np.array([0.0, 1.0, 0.0]))[0]
    assert RADIUS <= extent <= np.sqrt(3.0) * RADIUS + 1e-12
    column = bound.travel(np.array([1.0, 0.0, 0.0]))
    assert column == pytest.approx([LENGTH + extent, 2 * LENGTH + DRAWER + extent, 0.0])
    arm = bound.travel(np.array([0.0, 1.0, 0.0]))
    assert arm == pytest.approx([extent, LENGTH + DRAWER + extent, 0.0])
    assert bound.travel(np.array([0.0, 0.0, 0.1])) == pytest.approx([0.0, 0.1, 0.1])
    assert bound.largest == pytest.approx(bound.travel(np.ones(3)).max())


def test_many_travels_are_bounded_at_once() -> None:
    """Rows keep their order, and pairs that are asked for theirs."""
    bound, turned = MotionBound(*_arm()), np.random.default_rng(1).uniform(0.0, 1.0, (2, 4, 3))
    travel = bound.travel(turned, np.array([2, 0]))
    assert travel.shape == (2, 4, 2)
    assert travel[1, 3] == pytest.approx(bound.travel(turned[1, 3])[[2, 0]])


def test_no_distance_changes_by_more_than_the_bound() -> None:
    """Between 200 random pairs of postures, true distances change by the bound at most."""
    model, geometry = _arm()
    bound, rng = MotionBound(model, geometry), np.random.default_rng(0)
    data, distances = model.createData(), pin.GeometryData(geometry)
    closest = 0.0
    for _ in range(200):
        ends = rng.uniform(model.lowerPositionLimit, model.upperPositionLimit, (2, 3))
        ends[1] = ends[0] + rng.uniform(0.0, 0.2) * (ends[1] - ends[0])
        measured = []
        for q in ends:
            pin.computeDistances(model, data, geometry, distances, q)
            measured.append([result.min_distance for result in distances.distanceResults])
        change = np.abs(np.subtract(*measured))
        travel = bound.travel(np.abs(ends[1] - ends[0]))
        assert (change <= travel + 1e-9).all()
        closest = max(closest, float((change / travel).max()))
    assert closest > 0.5
