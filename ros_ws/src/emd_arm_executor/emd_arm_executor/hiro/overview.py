"""A second camera that films the cell from across the table."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from emd_arm_executor.hiro.render.renderer import Renderer
from emd_arm_executor.hiro.world import HiroWorld
from emd_core.frames import FloatArray
from emd_core.pinhole_camera import PinholeCamera
from emd_core.simulated_cloth import ClothShape


@dataclass(frozen=True)
class OverviewPlacement:
    """Where the camera stands.

    Attributes:
        position: In the table frame, metres.
        target: Point in the middle of the picture, table frame, metres.
        camera: Intrinsics.
    """

    position: tuple[float, float, float] = (-1.15, -0.80, 0.80)
    target: tuple[float, float, float] = (0.15, 0.0, 0.19)
    camera: PinholeCamera = PinholeCamera(480, 360, 400.0, 400.0, 239.5, 179.5)


class OverviewCamera:
    """Films robot, table and cloth without noise."""

    def __init__(
        self,
        world: HiroWorld,
        renderer: Renderer,
        placement: OverviewPlacement | None = None,
    ) -> None:
        """Stand where `placement` says."""
        self._world = world
        self._renderer = renderer
        self.placement = placement or OverviewPlacement()
        self._transform_camera_to_waist = world.geometry.transform_table_to_waist @ look_at(
            np.array(self.placement.position), np.array(self.placement.target)
        )

    def capture(self, cloth: ClothShape | None = None) -> NDArray[np.uint8]:
        """Take a picture, RGB, shape (H, W, 3)."""
        return self._renderer.photograph(
            self.placement.camera,
            self._transform_camera_to_waist,
            self._world.link_transforms_in_waist(),
            cloth,
        )


def look_at(position: FloatArray, target: FloatArray) -> FloatArray:
    """Pose of an optical frame at `position` that looks at `target` with z up, 4 x 4."""
    forward = (target - position) / np.linalg.norm(target - position)
    right = np.cross(forward, [0.0, 0.0, 1.0])
    right /= np.linalg.norm(right)
    transform = np.eye(4)
    transform[:3, :3] = np.column_stack([right, np.cross(forward, right), forward])
    transform[:3, 3] = position
    return transform
