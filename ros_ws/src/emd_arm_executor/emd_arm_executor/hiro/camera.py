"""The Kinect on HIRO's head."""

from __future__ import annotations

from dataclasses import dataclass

from emd_arm_executor.hiro.camera_noise import ColourImage, DepthImage, KinectNoise
from emd_arm_executor.hiro.render.renderer import Renderer
from emd_arm_executor.hiro.world import HiroWorld
from emd_core.frames import FloatArray
from emd_core.pinhole_camera import PinholeCamera
from emd_core.simulated_cloth import ClothShape, StillCloth


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


@dataclass(frozen=True)
class CameraView:
    """The cell at one moment, of which a picture can be taken while the cell goes on.

    Attributes:
        transform_camera_to_waist: Pose of the optical frame, 4 x 4.
        transform_camera_to_table: Likewise.
        link_transforms_in_waist: Of the robot's links, shape (L, 4, 4).
        cloth: What lies on the table; None if nothing does.
    """

    transform_camera_to_waist: FloatArray
    transform_camera_to_table: FloatArray
    link_transforms_in_waist: FloatArray
    cloth: StillCloth | None


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

    def capture(self, cloth: ClothShape | None = None) -> CameraFrame:
        """Take one pair of images of robot, table and cloth as they are now."""
        return self.take(self.view(cloth))

    def view(self, cloth: ClothShape | None = None) -> CameraView:
        """Keep what the camera sees now, for `take`."""
        return CameraView(
            self.transform_camera_to_waist,
            self.transform_camera_to_table,
            self.world.link_transforms_in_waist(),
            None if cloth is None else StillCloth.of(cloth),
        )

    def take(self, view: CameraView) -> CameraFrame:
        """Take one pair of images of a view; another thread may move the world meanwhile."""
        picture = self.renderer.render(
            self.camera,
            view.transform_camera_to_waist,
            view.link_transforms_in_waist,
            view.cloth,
        )
        colour, depth = picture.colour, picture.depth
        if self.noise is not None:
            colour = self.noise.colour(colour)
            depth = self.noise.depth(depth, self.camera)
        return CameraFrame(colour, depth, self.camera, view.transform_camera_to_table)
