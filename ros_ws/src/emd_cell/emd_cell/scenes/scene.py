"""A synthetic scene: what the cell's camera gives of it, and what is true."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from emd_arm_executor.hiro.camera_noise import KinectNoise
from emd_arm_executor.hiro.cell_geometry import CellGeometry
from emd_arm_executor.hiro.description import HANDS, OBSERVE
from emd_arm_executor.hiro.render.mesh import Segment
from emd_arm_executor.hiro.render.renderer import Renderer
from emd_arm_executor.hiro.world import HiroWorld
from emd_arm_executor.robot_description import hiro_description
from emd_arm_executor.robot_model import RobotModel
from emd_cell.scenes.cloth_states import ClothState, draw_state
from emd_cell.scenes.looks import Look, draw_look
from emd_cloth_sim.config import ClothConfig
from emd_cloth_sim.replay import resample_sheet
from emd_core.errors import OutOfReachError
from emd_core.frames import FieldOfView, FloatArray
from emd_core.pinhole_camera import PinholeCamera
from emd_core.voxel_grid import VoxelGrid, voxelise

HANDS_SHARE = 0.2  # of the scenes with a hand over the table
_CAMERA_STRAY = (0.02, 0.03)  # metres and radians, standard deviations
_GRID_SAMPLES = 81  # points a side of the sheet, as the paper's mesh has, for the true grid
_SAMPLES = 321  # for heights
_HAND_HEIGHTS = (0.03, 0.12)


@dataclass(frozen=True)
class Scene:
    """Frames of a scene at rest, and the truth.

    Attributes:
        name: Tells its number.
        look: What it is painted and lit with.
        state: The cloth.
        hand_in_view: Whether a hand of the robot hangs over the table.
        colours: Each of shape (H, W, 3), RGB uint8.
        depths: As many, shape (H, W), metres, NaN where unknown.
        camera: Of all images.
        transform_camera_to_table: Shape (4, 4).
        mask: Where cloth is seen, shape (H, W).
        grid: The true one.
        layers: Of cloth over the middle of each column, shape (X, Y).
        heights: Of the highest cloth in each column, shape (X, Y), metres; 0 without.
    """

    name: str
    look: Look
    state: ClothState
    hand_in_view: bool
    colours: list[NDArray[np.uint8]]
    depths: list[NDArray[np.float32]]
    camera: PinholeCamera
    transform_camera_to_table: FloatArray
    mask: NDArray[np.bool_]
    grid: VoxelGrid
    layers: NDArray[np.int64]
    heights: FloatArray


class SceneMaker:
    """Makes scenes by number; the same seed and number give the same scene."""

    def __init__(self, seed: int, cloth: ClothConfig, frames: int) -> None:
        """Set up the robot that stands in the scenes.

        Args:
            seed: Of everything drawn.
            cloth: The sheet.
            frames: Noisy frames of each scene.
        """
        self._seed, self._cloth, self._frames = seed, cloth, frames
        self._world, self._robot = HiroWorld(), RobotModel(hiro_description())
        self._geometry = CellGeometry()

    def make(self, number: int) -> Scene:
        """Draw, simulate, render and measure one scene."""
        rng = np.random.default_rng([self._seed, number])
        state = draw_state(rng, self._cloth)
        look = draw_look(rng, self._cloth, self._geometry)
        with_hand = bool(rng.random() < HANDS_SHARE) and self._reach_over(state, rng)
        to_waist = self._camera_pose(rng)
        renderer = Renderer(
            self._world.links,
            self._geometry,
            look.render,
            look.table_texture,
            look.cloth_colours,
        )
        camera = PinholeCamera()
        links = self._world.link_transforms_in_waist()
        picture = renderer.render(camera, to_waist, links, state)  # type: ignore[arg-type]
        noise = KinectNoise(rng)
        lit = look.lit(picture.colour)
        field_of_view = FieldOfView()
        self._world.reset(OBSERVE)
        return Scene(
            f"{number:04d}",
            look,
            state,
            with_hand,
            [noise.colour(lit) for _ in range(self._frames)],
            [noise.depth(picture.depth, camera) for _ in range(self._frames)],
            camera,
            self._geometry.transform_waist_to_table @ to_waist,
            picture.segmentation == Segment.CLOTH,
            voxelise(resample_sheet(state.top_surface, _GRID_SAMPLES), field_of_view),
            state.layers_at(column_centres(field_of_view)).reshape(field_of_view.size[:2]),
            _heights(state, field_of_view),
        )

    def _reach_over(self, state: ClothState, rng: np.random.Generator) -> bool:
        """Let a hand hang over a place of the cloth; whether it gets there."""
        place = state.positions[rng.integers(len(state.positions))]
        hand = int(place[1] > 0.0)
        target = np.diag([1.0, -1.0, -1.0, 1.0])
        target[:3, 3] = [*place[:2], place[2] + rng.uniform(*_HAND_HEIGHTS)]
        arm = self._robot.arms[HANDS[hand]]
        try:
            angles = arm.solve(
                self._robot.transform_table_to_base @ target, OBSERVE.positions(f"{arm.name}_arm")
            )
        except OutOfReachError:
            return False
        groups = {**OBSERVE.groups, f"{arm.name}_arm": tuple(angles)}
        self._world.reset(type(OBSERVE)("over the cloth", groups))
        return True

    def _camera_pose(self, rng: np.random.Generator) -> FloatArray:
        """Give a pose near that of the camera on HIRO's head, 4 x 4, to WAIST."""
        pose = self._world.transform_link_to_waist("camera_optical_frame").copy()
        pose[:3, 3] += rng.normal(0.0, _CAMERA_STRAY[0], 3)
        turn = Rotation.from_rotvec(rng.normal(0.0, _CAMERA_STRAY[1], 3)).as_matrix()
        pose[:3, :3] = pose[:3, :3] @ turn
        return pose


def _heights(state: ClothState, field_of_view: FieldOfView) -> FloatArray:
    points = resample_sheet(state.top_surface, _SAMPLES)
    heights = np.zeros(field_of_view.size[:2])
    index = np.floor((points[:, :2] + field_of_view.half_extent) / field_of_view.resolution[:2])
    held = ((index >= 0) & (index < np.array(heights.shape))).all(axis=1)
    np.maximum.at(heights, tuple(index[held].astype(int).T), points[held, 2])
    return heights


def column_centres(field_of_view: FieldOfView) -> FloatArray:
    """Give the middles of a grid's columns in the table frame, shape (X * Y, 2), metres."""
    count = field_of_view.size[:2]
    axes = [(np.arange(n) + 0.5) * (2.0 / n) - 1.0 for n in count]
    grid = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 2)
    return field_of_view.table_from_normalised(grid)
