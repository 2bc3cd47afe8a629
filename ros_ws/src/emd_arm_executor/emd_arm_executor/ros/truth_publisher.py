"""What only a simulation knows: the cloth's state and its true voxel grid."""

from __future__ import annotations

import numpy as np
from rclpy.node import Node
from sensor_msgs.msg import PointCloud2

from emd_core.frames import FieldOfView
from emd_core.ros import conversions
from emd_core.simulated_cloth import SimulatedCloth
from emd_core.voxel_grid import voxelise
from emd_msgs_py.msg import VoxelGrid as VoxelGridMsg


class TruthPublisher:
    """Publishes the cloth's vertices and the grid of its upper surface."""

    def __init__(self, node: Node) -> None:
        """Advertise the topics."""
        self._grid = node.create_publisher(VoxelGridMsg, "simulation/voxel_grid", 5)
        self._cloth = node.create_publisher(PointCloud2, "simulation/cloth", 5)

    def publish(self, cloth: SimulatedCloth, time: float) -> None:
        """Publish the state of `cloth` at `time`, simulated seconds."""
        header = conversions.header(time, conversions.TABLE_FRAME)
        points = cloth.positions_in_table
        self._cloth.publish(conversions.points_to_message(points, header))
        upper_surface = points + np.array([0.0, 0.0, cloth.thickness / 2])
        grid = voxelise(upper_surface, FieldOfView())
        self._grid.publish(conversions.voxel_grid_to_message(grid, header))
