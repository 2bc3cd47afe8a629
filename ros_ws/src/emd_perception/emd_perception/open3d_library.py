"""Open3D, loaded at first use: it takes a second and needs a system library."""

from __future__ import annotations

from functools import cache
from types import ModuleType
from typing import Any

from emd_core.errors import CellError
from emd_core.frames import FloatArray


@cache
def load_open3d() -> ModuleType:
    """Import Open3D.

    Raises:
        CellError: If it or a system library that it needs is missing.
    """
    try:
        import open3d
    except ImportError as err:
        raise CellError(
            f"Open3D is needed for point clouds and cannot be loaded ({err}); install the package "
            "open3d-cpu and, on Debian and Ubuntu, the system package libusb-1.0-0"
        ) from err
    return open3d  # type: ignore[no-any-return]


def point_cloud(points: FloatArray) -> Any:
    """Wrap points (N, 3) as an Open3D point cloud."""
    open3d = load_open3d()
    return open3d.geometry.PointCloud(open3d.utility.Vector3dVector(points))
