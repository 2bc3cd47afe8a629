"""The Kinect on HIRO's head."""

from __future__ import annotations

from dataclasses import dataclass

from emd_arm_executor.hiro.camera_noise import ColourImage, DepthImage, KinectNoise
from emd_arm_executor.hiro.render.renderer import Renderer
from emd_arm_executor.hiro.world import HiroWorld
from emd_core.frames import FloatArray
from emd_core.pinhole_camera import PinholeCamera
from emd_core.simulated_cloth import SimulatedCloth


@dataclass(frozen=True)
class CameraFrame:
    """One registered pair of images.

    Attributes:
        colour: RGB, shape (H, W, 3), uint8.
        depth: Along the optical axis, shape (H, W), float32 metres; NaN where not measured.
        camera: Intrinsics of both.
        transform_camera_to_table: Pose of the optical frame, 4 x 4.
    """

    colour: ColourImage
    depth: DepthImage
    camera: PinholeCamera
    transform_camera_to_table: FloatArray


class HeadCamera:
    """Sees the cell from where the head's joints have the camera."""

    def __init__(
        self,
        world: HiroWorld,
        renderer: Renderer | None = None,
        camera: PinholeCamera | None = None,
        noise: KinectNoise | None = None,
    ) -> None:
        """Mount the camera.

        Args:
            world: The robot.
            renderer: Draws the cell; one with the default look if None.
            camera: Intrinsics; a Kinect's if None.
            noise: What the sensor adds; none if None.
        """
        self.world = world
        self.renderer = renderer or Renderer(world.links, world.geometry)
        self.camera = camera or PinholeCamera()
        self.noise = noise

    @property
    def transform_camera_to_waist(self) -> FloatArray:
        """Pose of the optical frame now, 4 x 4."""
        return self.world.transform_link_to_waist("camera_optical_frame")

    @property
    def transform_camera_to_table(self) -> FloatArray:
        """Pose of the optical frame now, 4 x 4."""
        return self.world.geometry.transform_waist_to_table @ self.transform_camera_to_waist

    def capture(self, cloth: SimulatedCloth | None = None) -> CameraFrame:
        """Take one pair of images of robot, table and cloth as they are now."""
        picture = self.renderer.render(
            self.camera,
            self.transform_camera_to_waist,
            self.world.link_transforms_in_waist(),
            cloth,
        )
        colour, depth = picture.colour, picture.depth
        if self.noise is not None:
            colour = self.noise.colour(colour)
            depth = self.noise.depth(depth, self.camera)
        return CameraFrame(colour, depth, self.camera, self.transform_camera_to_table)
