"""From the cloth's surface to the voxel grid (paper, III-A and IV-B), robust to sensor noise."""

from __future__ import annotations

import numba
import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import distance_transform_edt

from emd_core.frames import FieldOfView, FloatArray
from emd_core.voxel_grid import VoxelGrid, voxelise
from emd_perception.cloth_points import ClothPoints
from emd_perception.config import VoxelConfig
from emd_perception.square_means import SquareMeans


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
    cells = _average_in_cells(cloth, field_of_view, settings)
    return voxelise(_match_columns(cells, cloth, field_of_view, settings), field_of_view)


def cells_per_voxel(
    cloth: ClothPoints, field_of_view: FieldOfView, config: VoxelConfig | None = None
) -> int:
    """Choose how finely columns are divided: as finely as the sensor's noise lets heights be told.

    The paper's rule takes the highest point of a column, and the highest of many noisy cells is
    too high, while the highest of few wide ones is too low wherever cloth is not level.
    """
    settings = config or VoxelConfig()
    side = float(field_of_view.resolution[0])
    least = cloth.height_error / settings.max_cell_error  # metres
    return int(np.clip(side / max(least, 1e-9), 1, settings.max_cells_per_voxel))


def _average_in_cells(
    cloth: ClothPoints, field_of_view: FieldOfView, config: VoxelConfig
) -> FloatArray:
    """Average points over squares that divide the columns evenly; drop nearly empty squares."""
    points = cloth.points_in_table
    divisions = cells_per_voxel(cloth, field_of_view, config)
    corner = np.array([field_of_view.half_extent, field_of_view.half_extent, 0.0])
    side = float(field_of_view.resolution[0]) / divisions
    cells = SquareMeans.of(points + corner, np.empty((len(points), 0), np.uint8), side)
    # A fine cell holds about one of the thinned-out points.
    wanted = config.min_points_in_cell if divisions <= 2 else 1
    return cells.points[cells.counts >= min(wanted, int(cells.counts.max()))] - corner


def _match_columns(
    cells: FloatArray, cloth: ClothPoints, field_of_view: FieldOfView, config: VoxelConfig
) -> FloatArray:
    """Keep the cells in columns that the mask covers; give the other covered columns a height.

    Returns:
        Shape (M, 3), metres, table frame.
    """
    resolution = field_of_view.resolution[:2]
    half = field_of_view.half_extent
    footprint = cloth.footprint_in_table
    bounds = [
        np.floor((end(axis=0) + half) * (1.0 / resolution))  # rounded as the pixels' columns are
        for end in (footprint.min, footprint.max)
    ]
    corner = bounds[0].astype(int)
    count = np.zeros(bounds[1].astype(int) - corner + 1, dtype=np.int64)
    _count_in_columns(footprint, half, resolution, corner, count)
    covered = count >= config.min_coverage * np.quantile(count[count > 0], 0.9)
    cell_index = np.floor((cells[:, :2] + half) / resolution).astype(int)
    cell_index = np.clip(cell_index - corner, 0, np.array(count.shape) - 1)
    kept = covered[cell_index[:, 0], cell_index[:, 1]]
    height = np.full(count.shape, -np.inf)
    np.maximum.at(height, (cell_index[:, 0], cell_index[:, 1]), cells[:, 2])
    nearest = distance_transform_edt(np.isinf(height), return_distances=False, return_indices=True)
    bare = covered & np.isinf(height)
    x, y = (np.nonzero(bare)[axis] + corner[axis] + 0.5 for axis in (0, 1))
    filled = np.column_stack(
        [
            x * resolution[0] - half,
            y * resolution[1] - half,
            height[nearest[0][bare], nearest[1][bare]],
        ]
    )
    return np.concatenate([cells[kept], filled])


@numba.njit(cache=True, nogil=True, error_model="numpy")
def _count_in_columns(
    footprint: FloatArray,
    half_extent: float,
    resolution: FloatArray,
    corner: NDArray[np.int64],
    count: NDArray[np.int64],
) -> None:
    """Count the pixels in each column; column (0, 0) is the one at `corner`."""
    scale = 1.0 / resolution
    for pixel in range(len(footprint)):
        row = np.int64(np.floor((footprint[pixel, 0] + half_extent) * scale[0]))
        column = np.int64(np.floor((footprint[pixel, 1] + half_extent) * scale[1]))
        count[row - corner[0], column - corner[1]] += 1
