"""From the cloth's pixels to the voxel grid (paper, III-A and IV-B), robust to sensor noise."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import distance_transform_edt

from emd_core.errors import NoClothError
from emd_core.frames import FieldOfView, FloatArray, transform_points
from emd_core.pinhole_camera import PinholeCamera
from emd_core.voxel_grid import VoxelGrid, voxelise
from emd_perception.config import VoxelConfig
from emd_perception.image_types import ColourImage, DepthImage, Mask
from emd_perception.open3d_library import load_open3d

# Heights are shrunk by this factor while points are averaged, so that Open3D's cubic cells
# average over the whole noise in z instead of sorting it into layers.
_Z_SHRINK = 0.02


@dataclass(frozen=True)
class ClothPoints:
    """The cloth's surface.

    Attributes:
        points_in_table: Averaged and cleaned points, shape (N, 3), metres, table frame.
        colours: Their mean colours, shape (N, 3), RGB uint8.
        footprint_in_table: x and y of every pixel of the mask, shape (P, 2), metres.
        known_share: Share of the mask's pixels that had a depth, 0..1.
    """

    points_in_table: FloatArray
    colours: NDArray[np.uint8]
    footprint_in_table: FloatArray
    known_share: float


def cloth_points(
    colour: ColourImage,
    depth: DepthImage,
    mask: Mask,
    camera: PinholeCamera,
    transform_camera_to_table: FloatArray,
    spacing: float,
    config: VoxelConfig | None = None,
) -> ClothPoints:
    """Unproject the cloth's pixels into the table frame, thin them out by averaging, and clean.

    Pixels of the mask without a depth take the height of the nearest pixel that has one, so that
    no part of the cloth vanishes.

    Args:
        colour: Shape (H, W, 3), RGB uint8.
        depth: Shape (H, W), metres, NaN where unknown.
        mask: The cloth's pixels, shape (H, W).
        camera: The camera of both images.
        transform_camera_to_table: Shape (4, 4), metres.
        spacing: Side of the squares over which points are averaged, metres.
        config: Outlier removal; the defaults if None.

    Raises:
        NoClothError: If no pixel of the mask has a depth.
    """
    settings = config or VoxelConfig()
    known = mask & np.isfinite(depth) & ~_spikes(depth, settings.max_spike)
    if not known.any():
        raise NoClothError(
            "the cloth was seen in the colour image, but no pixel of it has a depth; is it nearer "
            "than the sensor's minimum range, or black to its infrared light?"
        )
    points = _points_of_mask(depth, mask, known, camera, transform_camera_to_table)
    open3d = load_open3d()
    cloud = open3d.geometry.PointCloud(
        open3d.utility.Vector3dVector(points[known[mask]] * [1.0, 1.0, _Z_SHRINK])
    )
    cloud.colors = open3d.utility.Vector3dVector(colour[known] / 255.0)
    thin = cloud.voxel_down_sample(spacing)
    thin.points = open3d.utility.Vector3dVector(np.asarray(thin.points) / [1.0, 1.0, _Z_SHRINK])
    if len(thin.points) > settings.outlier_neighbours:
        thin, _ = thin.remove_statistical_outlier(
            settings.outlier_neighbours, settings.outlier_std_ratio
        )
    return ClothPoints(
        np.asarray(thin.points).copy(),
        np.rint(np.asarray(thin.colors) * 255.0).astype(np.uint8),
        points[:, :2],
        float(known.sum() / mask.sum()),
    )


def voxelise_cloth(
    cloth: ClothPoints, field_of_view: FieldOfView, config: VoxelConfig | None = None
) -> VoxelGrid:
    """Rasterise the cloth's surface.

    The columns are those that the mask covers; their height is that of the highest cell in them,
    a cell being the average over a square of a few points.

    Args:
        cloth: What `cloth_points` gave.
        field_of_view: The box and its voxels.
        config: Cells; the defaults if None.
    """
    settings = config or VoxelConfig()
    cells = _average_in_cells(cloth.points_in_table, field_of_view, settings)
    return voxelise(_match_columns(cells, cloth, field_of_view, settings), field_of_view)


def _spikes(depth: DepthImage, max_spike: float) -> Mask:
    """Pixels far from the median of the 5 x 5 around them, unknown neighbours apart."""
    middle = np.asarray(cv2.medianBlur(np.nan_to_num(depth, nan=0.0), 5))
    return (middle > 0) & (np.abs(depth - middle) > max_spike)


def _points_of_mask(
    depth: DepthImage,
    mask: Mask,
    known: Mask,
    camera: PinholeCamera,
    transform_camera_to_table: FloatArray,
) -> FloatArray:
    """Points of all pixels of the mask in the table frame, unknown depths filled, shape (P, 3)."""
    v, u = np.nonzero(mask)
    rays = np.column_stack([(u - camera.cx) / camera.fx, (v - camera.cy) / camera.fy])
    rays = np.column_stack([rays, np.ones(len(u))])
    distance = depth[v, u].astype(np.float64)
    points = transform_points(transform_camera_to_table, rays * distance[:, None])
    missing = ~known[v, u]
    if not missing.any():
        return points
    height = np.full(depth.shape, np.nan)
    height[v, u] = points[:, 2]
    nearest = distance_transform_edt(~known, return_distances=False, return_indices=True)
    filled = height[nearest[0][v, u], nearest[1][v, u]][missing]
    rays_in_table = rays[missing] @ transform_camera_to_table[:3, :3].T
    origin = transform_camera_to_table[:3, 3]
    reach = (filled - origin[2]) / rays_in_table[:, 2]
    points[missing] = origin + reach[:, None] * rays_in_table
    return points


def _average_in_cells(
    points: FloatArray, field_of_view: FieldOfView, config: VoxelConfig
) -> FloatArray:
    """Average points over squares that divide the columns evenly; drop nearly empty squares."""
    if len(points) == 0:
        return points
    side = float(field_of_view.resolution[0] / config.cells_per_voxel)
    open3d = load_open3d()
    cloud = open3d.geometry.PointCloud(
        open3d.utility.Vector3dVector(points * [1.0, 1.0, _Z_SHRINK])
    )
    half = field_of_view.half_extent
    beyond = np.ceil(np.abs(points[:, :2]).max() / half + 1.0) * half
    low, high = np.array([-beyond, -beyond, -1.0]), np.array([beyond, beyond, 1.0])
    averaged, _, members = cloud.voxel_down_sample_and_trace(side, low, high)
    counts = np.array([len(member) for member in members])
    cells = np.asarray(averaged.points) / [1.0, 1.0, _Z_SHRINK]
    full = counts >= min(config.min_points_in_cell, counts.max())
    return cells[full]


def _match_columns(
    cells: FloatArray, cloth: ClothPoints, field_of_view: FieldOfView, config: VoxelConfig
) -> FloatArray:
    """Keep the cells in columns that the mask covers; give the other covered columns a height.

    Returns:
        Shape (M, 3), metres, table frame.
    """
    resolution = field_of_view.resolution[:2]
    index = np.floor((cloth.footprint_in_table + field_of_view.half_extent) / resolution)
    corner = index.min(axis=0).astype(int)
    index = index.astype(int) - corner
    shape = tuple(index.max(axis=0) + 1)
    count = np.zeros(shape, dtype=int)
    np.add.at(count, (index[:, 0], index[:, 1]), 1)
    covered = count >= config.min_coverage * np.quantile(count[count > 0], 0.9)
    cell_index = np.floor((cells[:, :2] + field_of_view.half_extent) / resolution).astype(int)
    cell_index = np.clip(cell_index - corner, 0, np.array(shape) - 1)
    kept = covered[cell_index[:, 0], cell_index[:, 1]]
    height = np.full(shape, -np.inf)
    np.maximum.at(height, (cell_index[:, 0], cell_index[:, 1]), cells[:, 2])
    nearest = distance_transform_edt(np.isinf(height), return_distances=False, return_indices=True)
    bare = covered & np.isinf(height)
    x, y = (np.nonzero(bare)[axis] + corner[axis] + 0.5 for axis in (0, 1))
    filled = np.column_stack(
        [
            x * resolution[0] - field_of_view.half_extent,
            y * resolution[1] - field_of_view.half_extent,
            height[nearest[0][bare], nearest[1][bare]],
        ]
    )
    return np.concatenate([cells[kept], filled])
