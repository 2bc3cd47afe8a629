"""The planner node's parameters that name regions of the desk."""

from __future__ import annotations

import math
from pathlib import Path

from rcl_interfaces.msg import ParameterDescriptor
from rclpy.node import Node
from rclpy.parameter import Parameter

from emd_core.errors import InvalidInputError
from emd_core.reach_map import ReachMap
from emd_planner.config import Polygon, ReachConfig


def declare_reach(node: Node) -> ReachConfig | ReachMap | None:
    """Read the reach map that `reach.map` names, or each arm's polygon.

    Polygons are given as x0 y0 x1 y1 ... in metres; empty: no limit.
    """
    text = "file of a reach map, as ./cell reach writes it; empty: the polygons count"
    path = node.declare_parameter("reach.map", "", ParameterDescriptor(description=text)).value
    polygons = []
    for arm, default in vars(ReachConfig()).items():
        start = [float(value) for corner in default for value in corner]
        values = node.declare_parameter(f"reach.{arm}", start).value
        if len(values) % 2 or 0 < len(values) < 6:
            raise InvalidInputError(
                f"reach.{arm} needs x y of at least three corners, got {len(values)} values"
            )
        polygons.append(_corners(values))
    if path:
        return ReachMap.load(Path(path))
    return ReachConfig(*polygons) if all(polygons) else None


def declare_keep_out(node: Node) -> tuple[Polygon, ...]:
    """Read convex regions, given as x0 y0 x1 y1 ... in metres, NaN between regions."""
    text = "x y of each corner, metres, table frame; NaN between regions; empty: none"
    descriptor = ParameterDescriptor(description=text)
    node.declare_parameter("keep_out", Parameter.Type.DOUBLE_ARRAY, descriptor)
    nothing = Parameter("keep_out", Parameter.Type.DOUBLE_ARRAY, [])
    values = node.get_parameter_or("keep_out", nothing).value
    regions: list[list[float]] = [[]]
    for value in values:
        if math.isnan(value):
            regions.append([])
        else:
            regions[-1].append(value)
    regions = [region for region in regions if region]
    for region in regions:
        if len(region) % 2 or len(region) < 6:
            raise InvalidInputError(
                f"a region of keep_out needs x y of at least three corners, got {region}"
            )
    return tuple(_corners(region) for region in regions)


def _corners(values: list[float]) -> Polygon:
    return tuple((float(x), float(y)) for x, y in zip(values[::2], values[1::2], strict=True))
