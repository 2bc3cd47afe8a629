"""Markers with which RViz and Foxglove show what the cell sees and intends."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from geometry_msgs.msg import Point, Vector3
from std_msgs.msg import ColorRGBA, Header
from visualization_msgs.msg import Marker

from emd_core.frames import FloatArray
from emd_core.manipulation import Manipulation
from emd_core.voxel_grid import VoxelGrid

BLUE = (0.0, 0.45, 0.70)
ORANGE = (0.90, 0.62, 0.0)
GREEN = (0.0, 0.62, 0.45)
Colour = tuple[float, float, float]


def voxel_marker(
    grid: VoxelGrid, header: Header, namespace: str, colour: Colour = BLUE, alpha: float = 0.6
) -> Marker:
    """Show the top voxel of every occupied column as a cube."""
    fov = grid.field_of_view
    x, y = np.nonzero(grid.silhouette)
    z = grid.occupancy.shape[2] - 1 - np.argmax(grid.occupancy[x, y, ::-1], axis=1)
    centres = fov.origin + (np.column_stack([x, y, z]) + 0.5) * fov.resolution
    marker = _marker(header, namespace, 0, Marker.CUBE_LIST, colour, alpha)
    marker.scale = _vector(fov.resolution)
    marker.points = _points(centres)
    return marker


def manipulation_markers(
    manipulations: Sequence[Manipulation], header: Header, namespace: str, height: float = 0.03
) -> list[Marker]:
    """Show every used grasp point's way to its release point as an arrow."""
    markers = []
    for step, manipulation in enumerate(manipulations):
        for hand in range(2):
            if not manipulation.used[hand]:
                continue
            marker = _marker(header, namespace, 2 * step + hand, Marker.ARROW, ORANGE, 1.0)
            marker.scale = Vector3(x=0.006, y=0.014, z=0.02)
            ends = [
                manipulation.grasp_points_in_table[hand],
                manipulation.release_points_in_table[hand],
            ]
            marker.points = _points(np.column_stack([ends, [height, height]]))
            markers.append(marker)
    return markers


def line_marker(
    points_in_table: FloatArray,
    header: Header,
    namespace: str,
    identifier: int = 0,
    colour: Colour = GREEN,
) -> Marker:
    """Show points (N, 3) as a connected line, such as a hem or a row of via-poses."""
    marker = _marker(header, namespace, identifier, Marker.LINE_STRIP, colour, 1.0)
    marker.scale.x = 0.004
    marker.points = _points(points_in_table)
    return marker


def clear_marker(header: Header, namespace: str) -> Marker:
    """Remove everything shown before in a namespace."""
    return Marker(header=header, ns=namespace, action=Marker.DELETEALL)


def _marker(
    header: Header, namespace: str, identifier: int, kind: int, colour: Colour, alpha: float
) -> Marker:
    marker = Marker(header=header, ns=namespace, id=identifier, type=kind, action=Marker.ADD)
    marker.pose.orientation.w = 1.0
    marker.color = ColorRGBA(r=colour[0], g=colour[1], b=colour[2], a=alpha)
    return marker


def _points(values: FloatArray) -> list[Point]:
    return [Point(x=float(x), y=float(y), z=float(z)) for x, y, z in np.asarray(values)]


def _vector(values: FloatArray) -> Vector3:
    return Vector3(x=float(values[0]), y=float(values[1]), z=float(values[2]))
