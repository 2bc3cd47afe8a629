"""The hands' paths in space: lowering, insertion, carrying, retreat (paper, IV-B and Fig. 5).

Hands that move alike hang on one oriented point and keep their pose relative to it (paper, IV-B
items 3 and 4). Poses are 4 x 4 matrices into the table frame.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation, Slerp

from emd_arm_executor.config import PathConfig
from emd_core.errors import InvalidInputError
from emd_core.frames import FloatArray

# Resolution at which the carrying path is drawn before it is thinned out, metres.
_DRAWING_STEP = 0.001


@dataclass(frozen=True)
class OrientedPoint:
    """The point whose motion both hands follow.

    Attributes:
        position_in_table: Shape (3,), metres.
        yaw: Angle about the table's z axis, radians.
    """

    position_in_table: FloatArray
    yaw: float = 0.0

    @property
    def transform_to_table(self) -> FloatArray:
        """Pose of the point, shape (4, 4)."""
        transform = np.eye(4)
        transform[:3, :3] = Rotation.from_euler("z", self.yaw).as_matrix()
        transform[:3, 3] = self.position_in_table
        return transform


def line_poses(start: FloatArray, end: FloatArray, config: PathConfig | None = None) -> FloatArray:
    """Interpolate translation and rotation linearly between poses, densely.

    Args:
        start: Poses of H hands, shape (H, 4, 4).
        end: Where they go, shape (H, 4, 4).
        config: Step sizes.

    Returns:
        Shape (H, N, 4, 4), N >= 2; neighbours are at most a step apart.
    """
    config = config or PathConfig()
    # A hand that does not turn, as most do not, needs no interpolation of its rotation.
    turning = {
        h: Rotation.from_matrix(np.stack([start[h], end[h]])[:, :3, :3])
        for h in range(len(start))
        if not np.array_equal(start[h, :3, :3], end[h, :3, :3])
    }
    distance = np.linalg.norm(end[:, :3, 3] - start[:, :3, 3], axis=1).max()
    angle = max(((pair[0].inv() * pair[1]).magnitude() for pair in turning.values()), default=0.0)
    steps = max(distance / config.linear_step, angle / config.angular_step, 1.0)
    fractions = np.linspace(0.0, 1.0, int(np.ceil(steps - 1e-9)) + 1)
    poses = np.zeros((len(start), len(fractions), 4, 4))
    poses[..., 3, 3] = 1.0
    for h in range(len(start)):
        poses[h, :, :3, :3] = start[h, :3, :3]
        if h in turning:
            poses[h, :, :3, :3] = Slerp([0.0, 1.0], turning[h])(fractions).as_matrix()
        offset = end[h, :3, 3] - start[h, :3, 3]
        poses[h, :, :3, 3] = start[h, :3, 3] + fractions[:, None] * offset
    return poses


def carry_poses(
    grasp: OrientedPoint,
    release: OrientedPoint,
    config: PathConfig | None = None,
    count: int = 0,
) -> FloatArray:
    """Carry the oriented point from the grasp to the release: raise, go level, lower (Fig. 5).

    With the shape "vertical" the point rises to the lift height before it advances and comes
    down after. With "arc" it advances on the way up and down, on the circle about the crease that
    the held hem describes when the cloth folds without being dragged:
    (x - x_crease)^2 + h^2 <= (S / 2)^2, S the displacement. In both, the level part lies at the
    lift height, position and yaw change linearly with the distance covered, and the corners are
    rounded inside the path's convex hull, so that neither bound is overstepped.

    Args:
        grasp: Pose of the point when the jaws have closed.
        release: Pose when they open.
        config: Shape, lift height and step sizes.
        count: Least number of poses, so that ways of different lengths can have equally many.

    Returns:
        Poses of the point, equally far apart along the way, shape (N, 4, 4).

    Raises:
        InvalidInputError: If the shape is unknown or the displacement is too short.
    """
    config = config or PathConfig()
    offset = release.position_in_table[:2] - grasp.position_in_table[:2]
    span = float(np.hypot(*offset))
    if span < config.minimum_displacement:
        raise InvalidInputError(
            f"a displacement of at least {config.minimum_displacement * 1e3:.0f} mm is wanted, "
            f"got {span * 1e3:.1f} mm; leave this manipulation out"
        )
    heights = (float(grasp.position_in_table[2]), float(release.position_in_table[2]))
    turn = float(np.angle(np.exp(1j * (release.yaw - grasp.yaw))))
    outline = _round_corners(_outline(span, heights, config), config.blend)
    progress, height = _thin_out(outline, abs(turn) / span, config, count).T
    fraction = progress / span
    poses = np.zeros((len(fraction), 4, 4))
    poses[:, 3, 3] = 1.0
    yaw = grasp.yaw + fraction * turn
    poses[:, :3, :3] = Rotation.from_euler("z", yaw[:, None]).as_matrix()
    poses[:, :2, 3] = grasp.position_in_table[:2] + fraction[:, None] * offset
    poses[:, 2, 3] = height
    return poses


def _outline(span: float, heights: tuple[float, float], config: PathConfig) -> FloatArray:
    """Draw the path's corners or curves in the plane (distance covered, height), shape (M, 2)."""
    top = max(config.lift_height, max(heights) + config.minimum_displacement)
    if config.lift_shape == "vertical":
        return np.array([[0.0, heights[0]], [0.0, top], [span, top], [span, heights[1]]])
    if config.lift_shape != "arc":
        raise InvalidInputError(
            f'lift_shape must be "arc" or "vertical", got "{config.lift_shape}"'
        )
    angle = np.linspace(0.0, np.pi, 2001)
    progress = span / 2.0 * (1.0 - np.cos(angle))
    ground = heights[0] + (heights[1] - heights[0]) * progress / span
    return np.stack([progress, np.minimum(ground + span / 2.0 * np.sin(angle), top)], axis=1)


def _round_corners(outline: FloatArray, half_width: float) -> FloatArray:
    """Average the path over a window that slides along it; its ends stay where they are.

    A weighted mean of points of a convex set lies in the set: the path stays under the lift
    height and inside the circle about the crease.
    """
    length = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(outline, axis=0), axis=1)))
    count = max(8, int(np.ceil(length[-1] / _DRAWING_STEP)))
    where = np.linspace(0.0, length[-1], count + 1)
    drawn = np.stack([np.interp(where, length, column) for column in outline.T], axis=1)
    reach = int(min(half_width / (length[-1] / count), count // 4))
    if reach < 2:
        return drawn
    weights = 1.0 + np.cos(np.linspace(-np.pi, np.pi, 2 * reach + 1))
    weights /= weights.sum()
    # Point reflection at the ends keeps them fixed and straight beginnings straight.
    before = 2.0 * drawn[0] - drawn[reach:0:-1]
    after = 2.0 * drawn[-1] - drawn[-2 : -reach - 2 : -1]
    extended = np.concatenate([before, drawn, after])
    columns = [np.convolve(column, weights, mode="valid") for column in extended.T]
    return np.stack(columns, axis=1)


def _thin_out(
    outline: FloatArray, turn_per_metre: float, config: PathConfig, least: int
) -> FloatArray:
    """Keep points at equal distances along the path, no more than a step apart."""
    steps = np.linalg.norm(np.diff(outline, axis=0), axis=1)
    length = np.append(0.0, np.cumsum(steps))
    step = config.linear_step
    if turn_per_metre > 0.0:
        step = min(step, config.angular_step / turn_per_metre)
    count = max(2, int(np.ceil(length[-1] / step)), least - 1)
    where = np.linspace(0.0, length[-1], count + 1)
    return np.stack([np.interp(where, length, column) for column in outline.T], axis=1)
