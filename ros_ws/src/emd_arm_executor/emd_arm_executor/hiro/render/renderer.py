"""Pictures of the cell: colour, metric depth and segmentation from any pinhole camera."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from emd_arm_executor.hiro.cell_geometry import CellGeometry
from emd_arm_executor.hiro.render.cloth_mesh import ClothMesher
from emd_arm_executor.hiro.render.mesh import Colour, Mesh, merge
from emd_arm_executor.hiro.render.rasteriser import draw_parallel, draw_perspective
from emd_arm_executor.hiro.render.robot_mesh import RobotMesh
from emd_arm_executor.hiro.render.scenery import WOOD_TEXEL, scenery, wood_texture
from emd_arm_executor.hiro.render.shading import shade
from emd_core.errors import InvalidInputError
from emd_core.frames import FloatArray, inverse_transform
from emd_core.pinhole_camera import PinholeCamera
from emd_core.simulated_cloth import ClothShape


@dataclass(frozen=True)
class RenderConfig:
    """How the cell looks.

    Attributes:
        cloth_outside: Colour of the cloth's upper side, 0..1.
        cloth_inside: Colour of its lower side, 0..1.
        background: Colour where there is nothing, 0..1.
        light_direction: Towards the lamp, WAIST frame.
        ambient: Share of light from all around.
        lamp: Share of light from the lamp.
        shadows: Whether the lamp throws shadows; a picture without them takes less time.
        shadow_size: Pixels a side of the lamp's picture.
        shadow_extent: Metres a side of the lamp's picture, about the table frame's origin.
        solids: Whether to draw the robot's collision shapes instead of its looks.
        near: What is nearer to the camera than this is not drawn, metres.
    """

    cloth_outside: Colour = (0.20, 0.38, 0.68)
    cloth_inside: Colour = (0.62, 0.76, 0.92)
    background: Colour = (0.80, 0.83, 0.86)
    light_direction: tuple[float, float, float] = (0.35, 0.55, 1.0)
    ambient: float = 0.64
    lamp: float = 0.46
    shadows: bool = True
    shadow_size: int = 512
    shadow_extent: float = 1.5
    solids: bool = False
    near: float = 0.05

    def __post_init__(self) -> None:
        """Check the ranges.

        Raises:
            InvalidInputError: If a colour leaves 0..1, the light has no direction, or a size is
                not positive.
        """
        for name in ("cloth_outside", "cloth_inside", "background"):
            colour = getattr(self, name)
            if len(colour) != 3 or min(colour) < 0 or max(colour) > 1:
                raise InvalidInputError(f"{name} must be three values in 0..1, got {colour}")
        if np.linalg.norm(self.light_direction) < 1e-6:
            raise InvalidInputError("light_direction must have a length, got 0 0 0")
        if self.shadow_size < 2 or self.shadow_extent <= 0 or self.near <= 0:
            raise InvalidInputError(f"sizes of a picture must be positive, got {self}")


@dataclass(frozen=True)
class Picture:
    """What a camera would see without any noise.

    Attributes:
        colour: RGB, shape (H, W, 3), uint8.
        depth: Along the optical axis, shape (H, W), float32 metres; NaN where nothing is.
        segmentation: `Segment` of each pixel, shape (H, W), uint8.
    """

    colour: NDArray[np.uint8]
    depth: NDArray[np.float32]
    segmentation: NDArray[np.uint8]


class Renderer:
    """Draws robot, table, floor and cloth."""

    def __init__(
        self,
        links: Sequence[str],
        geometry: CellGeometry | None = None,
        config: RenderConfig | None = None,
        table_texture: NDArray[np.float32] | None = None,
        cloth_colours: NDArray[np.float32] | None = None,
    ) -> None:
        """Prepare the meshes.

        Args:
            links: Names of the robot's links, in the order of the transforms given to `render`.
            geometry: Where table and floor are.
            config: How the cell looks.
            table_texture: The table top, of the shape that `scenery.wood_texture` gives; wood if
                None.
            cloth_colours: Of the cloth's triangles, shape (T, 3), 0..1, seen on both sides; those
                of the config if None.
        """
        self.geometry = geometry or CellGeometry()
        self.config = config or RenderConfig()
        self._scenery = scenery(self.geometry)
        self._robot = RobotMesh.from_urdf(links, self.config.solids)
        depth, width, _ = self.geometry.table_size
        corner = self.geometry.table_centre_in_waist - np.array([depth / 2, width / 2, 0])
        self._wood = (
            wood_texture(self.geometry) if table_texture is None else table_texture,
            np.array([corner[0], corner[1], WOOD_TEXEL]),
        )
        self._cloth_colours = cloth_colours
        self._mesher: ClothMesher | None = None
        self._mesher_key: tuple[int, int, float] = (0, 0, 0.0)
        self._light = np.array(self.config.light_direction, dtype=np.float64)
        self._light /= np.linalg.norm(self._light)
        self._waist_to_shadow = self._light_projection()

    def render(
        self,
        camera: PinholeCamera,
        transform_camera_to_waist: FloatArray,
        link_transforms_in_waist: FloatArray | None = None,
        cloth: ClothShape | None = None,
    ) -> Picture:
        """Draw the cell.

        Args:
            camera: Intrinsics; pixel centres lie at whole numbers.
            transform_camera_to_waist: Pose of the optical frame, 4 x 4.
            link_transforms_in_waist: Shape (L, 4, 4); without them the robot is left out.
            cloth: What lies on the table; none if None.
        """
        mesh = self._scene(link_transforms_in_waist, cloth)
        to_camera = inverse_transform(transform_camera_to_waist)
        in_camera = mesh.vertices @ to_camera[:3, :3].T + to_camera[:3, 3]
        intrinsics = np.array([camera.fx, camera.fy, camera.cx, camera.cy])
        keys = np.zeros((camera.height, camera.width))
        indices = np.full(keys.shape, -1, dtype=np.int32)
        draw_perspective(in_camera, mesh.triangles, intrinsics, self.config.near, keys, indices)
        image = np.empty((*keys.shape, 3), dtype=np.uint8)
        depth = np.full(keys.shape, np.nan, dtype=np.float32)
        segmentation = np.zeros(keys.shape, dtype=np.uint8)
        surface = (
            mesh.vertices,
            mesh.normals,
            mesh.triangles,
            mesh.colours,
            mesh.smooth,
            mesh.materials,
            mesh.segments,
        )
        lamp = np.array([*self._light, self.config.ambient, self.config.lamp])
        shade(
            keys,
            indices,
            intrinsics,
            np.ascontiguousarray(transform_camera_to_waist),
            surface,
            self._wood,
            (lamp, self._shadow_keys(mesh), self._waist_to_shadow),
            np.round(255 * np.array(self.config.background)).astype(np.uint8),
            image,
            depth,
            segmentation,
        )
        return Picture(image, depth, segmentation)

    def photograph(
        self,
        camera: PinholeCamera,
        transform_camera_to_waist: FloatArray,
        link_transforms_in_waist: FloatArray | None = None,
        cloth: ClothShape | None = None,
        samples: int = 2,
    ) -> NDArray[np.uint8]:
        """Draw a colour picture with smooth edges, shape (H, W, 3); for films and figures.

        Args:
            camera: Intrinsics.
            transform_camera_to_waist: Pose of the optical frame, 4 x 4.
            link_transforms_in_waist: Shape (L, 4, 4); without them the robot is left out.
            cloth: What lies on the table; none if None.
            samples: Rays a side of each pixel, >= 1; the cost grows with their square.
        """
        if samples < 1:
            raise InvalidInputError(f"at least one sample a pixel is wanted, got {samples}")
        finer = PinholeCamera(
            camera.width * samples,
            camera.height * samples,
            camera.fx * samples,
            camera.fy * samples,
            (camera.cx + 0.5) * samples - 0.5,
            (camera.cy + 0.5) * samples - 0.5,
        )
        picture = self.render(finer, transform_camera_to_waist, link_transforms_in_waist, cloth)
        blocks = picture.colour.reshape(camera.height, samples, camera.width, samples, 3)
        return np.rint(blocks.mean(axis=(1, 3))).astype(np.uint8)

    def _scene(
        self, link_transforms_in_waist: FloatArray | None, cloth: ClothShape | None
    ) -> Mesh:
        parts = [self._scenery]
        if link_transforms_in_waist is not None:
            parts.append(self._robot.posed(link_transforms_in_waist))
        if cloth is not None:
            in_table = self._cloth_mesher(cloth).mesh(cloth.positions_in_table)
            parts.append(in_table.moved(self.geometry.transform_table_to_waist))
        return merge(parts)

    def _cloth_mesher(self, cloth: ClothShape) -> ClothMesher:
        triangles = cloth.triangles
        key = (len(triangles), int(triangles.max()), cloth.thickness)
        if self._mesher is None or key != self._mesher_key:
            config = self.config
            self._mesher = ClothMesher(
                triangles, cloth.thickness, config.cloth_outside, config.cloth_inside
            )
            if self._cloth_colours is not None:
                self._mesher.paint(self._cloth_colours)
            self._mesher_key = key
        return self._mesher

    def _light_projection(self) -> FloatArray:
        """Map a point to column, row and key (height towards the lamp) of the lamp's picture."""
        up = np.array([1.0, 0.0, 0.0])
        across = np.cross(up, self._light)
        across /= np.linalg.norm(across)
        along = np.cross(self._light, across)
        scale = self.config.shadow_size / self.config.shadow_extent
        centre = np.array(self.geometry.table_origin_in_waist)
        matrix = np.zeros((3, 4))
        matrix[:, :3] = [scale * across, scale * along, self._light]
        middle = self.config.shadow_size / 2
        matrix[:, 3] = np.array([middle, middle, 0.0]) - matrix[:, :3] @ centre
        return matrix

    def _shadow_keys(self, mesh: Mesh) -> FloatArray:
        if not self.config.shadows:
            return np.zeros((1, 1))
        projected = mesh.vertices @ self._waist_to_shadow[:, :3].T + self._waist_to_shadow[:, 3]
        keys = np.full((self.config.shadow_size, self.config.shadow_size), -np.inf)
        indices = np.full(keys.shape, -1, dtype=np.int32)
        draw_parallel(projected, mesh.triangles, keys, indices)
        return keys
