"""How a hand stands at a hem (paper, IV-B), and what that does to the displacement."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from emd_arm_executor.config import GraspConfig
from emd_arm_executor.hem import Hem
from emd_core.frames import FloatArray

# Cosine between hem normal and motion above which a hand pulls the cloth outwards.
_PULLING = 0.5


@dataclass(frozen=True)
class GraspPose:
    """One way for a hand to grip a hem.

    The jaws open along the approach direction. The hand has two equal fingers, so turning it by
    half a turn about its own axis grips the same.

    Attributes:
        hem: The place and its outward normal.
        position_in_table: Origin of the tool frame while gripping, shape (3,), metres.
        direction: Horizontal unit vector along which the hand comes, into the cloth, shape (2,).
        tilt: Leaning of the fingers into the cloth, radians; 0: the hand is vertical.
        flipped: Whether the hand is turned by half a turn.
    """

    hem: Hem
    position_in_table: FloatArray
    direction: FloatArray
    tilt: float = 0.0
    flipped: bool = False

    @property
    def transform_tool_to_table(self) -> FloatArray:
        """Pose of the gripping hand, shape (4, 4)."""
        return self.at(0.0, 0.0)

    @property
    def held_point_in_table(self) -> FloatArray:
        """Where the cloth is held, shape (2,), metres."""
        return self.position_in_table[:2]

    def at(self, retraction: float, rise: float) -> FloatArray:
        """Give the hand's pose drawn back against its direction and raised, shape (4, 4)."""
        inward = np.array([*self.direction, 0.0])
        up = np.array([0.0, 0.0, 1.0])
        cosine, sine = np.cos(self.tilt), np.sin(self.tilt)
        opening = cosine * inward + sine * up
        fingers = sine * inward - cosine * up
        across = np.array([self.direction[1], -self.direction[0], 0.0])
        if self.flipped:
            opening, across = -opening, -across
        transform = np.eye(4)
        transform[:3, :3] = np.stack([opening, across, fingers], axis=1)
        transform[:3, 3] = self.position_in_table - retraction * inward + rise * up
        return transform


def grasp_poses(hem: Hem, config: GraspConfig | None = None) -> Iterator[GraspPose]:
    """Yield the ways to grip one hem, those that follow the paper most closely first.

    The hand is vertical and comes orthogonally to the hem; then it may lean, then turn. It does
    not turn away from a direction that was asked for.
    """
    config = config or GraspConfig()
    for direction in _directions(hem, config):
        held = hem.point_in_table + config.insertion * direction
        position = np.array([*held, config.grip_height])
        for tilt in config.tilts:
            for flipped in (False, True):
                yield GraspPose(hem, position, direction, tilt, flipped)


def _directions(hem: Hem, config: GraspConfig) -> Iterator[FloatArray]:
    """Yield horizontal unit vectors into the cloth, shape (2,)."""
    if hem.asked_direction is not None:
        yield hem.asked_direction
        return
    for deviation in config.yaw_deviations:
        cosine, sine = np.cos(deviation), np.sin(deviation)
        yield -np.array([[cosine, -sine], [sine, cosine]]) @ hem.outward_normal


def displacement_keeping_crease(
    displacement_in_table: FloatArray,
    planned_points_in_table: FloatArray,
    grasps: Sequence[GraspPose],
    jaw_depth: float = 0.0,
) -> FloatArray:
    """Correct a displacement for grips that are not where the plan put them.

    A fold that takes the point g to g + S u (u: unit vector of the motion) lays the crease on the
    perpendicular bisector, at distance S / 2 from g along u. A hand that grips at g + s instead
    keeps that crease with the length S - 2 s.u: a grip shifted by a against the motion travels
    2 a further, one shifted forward (an insertion behind the hem) less. Shifts across the motion
    leave the crease where it is. The hand does not turn over with the flap: the cloth between its
    jaws goes on facing up and leaves them `jaw_depth` further along u than the held point, at both
    ends of the motion alike, which takes another 2 `jaw_depth` off the length. Two hands share one
    displacement, so the mean of their shifts counts. A hand whose hem faces along the motion
    (within 60 degrees) pulls the cloth instead of folding it: there is no crease and its
    displacement stays.

    Args:
        displacement_in_table: As planned, shape (2,), metres.
        planned_points_in_table: As planned, shape (N, 2), metres.
        grasps: The N grips.
        jaw_depth: How far inside the held point the cloth leaves the jaws, metres.

    Returns:
        The displacement of the hands, shape (2,), metres; along the planned one.
    """
    length = float(np.linalg.norm(displacement_in_table))
    if length == 0.0:
        return displacement_in_table
    along = displacement_in_table / length
    folds = [grasp.hem.outward_normal @ along < _PULLING for grasp in grasps]
    if not all(folds):
        return displacement_in_table
    shifts = [
        (grasp.held_point_in_table - planned) @ along
        for grasp, planned in zip(grasps, planned_points_in_table, strict=True)
    ]
    return np.asarray(along * max(length - 2.0 * (float(np.mean(shifts)) + jaw_depth), 0.0))


def share_displacement(displacements_in_table: FloatArray) -> bool:
    """Tell whether hands with these displacements (N, 2) all move alike."""
    return bool((displacements_in_table == displacements_in_table[0]).all())


def displacements_keeping_creases(
    displacements_in_table: FloatArray,
    planned_points_in_table: FloatArray,
    grasps: Sequence[GraspPose],
    jaw_depth: float = 0.0,
) -> FloatArray:
    """Correct displacements (N, 2): hands that move alike make one crease, others each their own.

    Arguments are those of `displacement_keeping_crease`, with a displacement for each grip.
    """
    together = share_displacement(displacements_in_table)
    groups = [slice(None)] if together else [slice(i, i + 1) for i in range(len(grasps))]
    corrected = np.array(displacements_in_table, dtype=np.float64)
    for group in groups:
        planned = displacements_in_table[group][0]
        points = planned_points_in_table[group]
        corrected[group] = displacement_keeping_crease(planned, points, grasps[group], jaw_depth)
    return corrected
